// Every duty of docs/link.md on the controller's side. `duties.py` takes each duty out of the
// header and checks that the test of that duty fails.
#include <HbotLink.h>
#include <cmath>
#include <cstring>
#include <doctest/doctest.h>
#include <limits>

#include "page.h"

namespace {

// What the two functions of the builder have seen, and what they report.
struct Hardware {
    hbot::Reading readings[2];
    float torque[2];
    bool on;
    int reads;
    int drives;
};
Hardware hardware;

void readJoints(hbot::Reading *readings) {
    hardware.reads++;
    readings[0] = hardware.readings[0];
    readings[1] = hardware.readings[1];
}

void driveJoints(const float *torque, bool on) {
    hardware.drives++;
    hardware.torque[0] = torque[0];
    hardware.torque[1] = torque[1];
    hardware.on = on;
}

const hbot::Joint joints[] = {{4096, 1.0f, 80.0f}, {8192, 0.5f, 0.0f}};

// A feedback as the host decodes it.
struct Answer {
    bool any;
    uint32_t sequence;
    uint16_t flags;
    std::vector<hbot::Reading> readings;
};

Answer decoded(const Bytes &frame) {
    Answer answer = {false, 0, 0, {}};
    if (frame.empty()) {
        return answer;
    }
    const Bytes body = bodyOf(frame);
    hbot::detail::Reader reader(body.data(), body.size());
    uint8_t number = 0, count = 0;
    bool ok = reader.byte(number) && number == 1 && reader.varint(answer.sequence) &&
              reader.varint(answer.flags) && reader.varint(count);
    for (uint8_t j = 0; ok && j < count; j++) {
        hbot::Reading reading = {};
        uint32_t zigzag = 0;
        ok = reader.varint(zigzag) && reader.real(reading.rate) && reader.real(reading.current) &&
             reader.real(reading.temperature) && reader.varint(reading.flags);
        reading.count = static_cast<int32_t>((zigzag >> 1) ^ (~(zigzag & 1u) + 1u));
        answer.readings.push_back(reading);
    }
    answer.any = ok && reader.atEnd();
    REQUIRE(answer.any);
    return answer;
}

Bytes commandFrame(uint32_t sequence, bool enable, uint16_t watchdogMs,
                  const std::vector<float> &torque) {
    Bytes frame(hbot::commandFrameBytes(torque.size()));
    hbot::FrameWriter writer(frame.data());
    writer.byte(1);
    writer.varint(sequence);
    writer.byte(enable ? 1 : 0);
    writer.varint(watchdogMs);
    writer.varint(static_cast<uint32_t>(torque.size()));
    for (float one : torque) {
        writer.real(one);
    }
    frame.resize(writer.finish());
    return frame;
}

// A device with two joints and a clock.
struct Bench {
    uint32_t nowUs;
    uint32_t sequence = 0;
    hbot::Device<2> device{"duties 1.0", joints, readJoints, driveJoints};

    explicit Bench(bool described = true, uint32_t startUs = 1000000) : nowUs(startUs) {
        hardware = Hardware();
        // Not the value that `begin` must set.
        hardware.torque[0] = hardware.torque[1] = 9.0f;
        device.begin();
        if (described) {
            describe();
        }
    }

    // Feeds bytes and returns the bytes of all answers.
    Bytes feed(const Bytes &bytes) {
        Bytes answers;
        for (uint8_t byte : bytes) {
            const size_t length = device.receive(byte, nowUs);
            answers.insert(answers.end(), device.answer(), device.answer() + length);
        }
        return answers;
    }

    Bytes describe() {
        return feed(page().vectors.at("describe").at("frame"));
    }

    Answer command(bool enable, const std::vector<float> &torque, uint16_t watchdogMs = 20) {
        return decoded(feed(commandFrame(++sequence, enable, watchdogMs, torque)));
    }

    Answer push() { return command(true, {0.25f, -0.125f}); }
    Answer release() { return command(false, {0.0f, 0.0f}); }

    // Lets time pass, ms, without bytes.
    void pass(uint32_t ms) {
        for (uint32_t i = 0; i < ms; i++) {
            nowUs += 1000;
            device.poll(nowUs);
        }
    }
};

bool pushes() {
    return hardware.on && hardware.torque[0] == 0.25f && hardware.torque[1] == -0.125f;
}
bool isFree() { return !hardware.on && hardware.torque[0] == 0.0f && hardware.torque[1] == 0.0f; }

constexpr float NotANumber = std::numeric_limits<float>::quiet_NaN();
constexpr float Infinite = std::numeric_limits<float>::infinity();

} // namespace

TEST_CASE("conversation: a description for each Describe, a feedback for each command, no more") {
    Bench bench(false);
    const Bytes body = bodyOf(bench.describe());
    const Bytes expected = {0,   1,   10,  'd', 'u', 't',  'i',  'e', 's',  ' ',
                            '1', '.', '0', 2,   0x80, 0x20, 0x80, 0x40};
    CHECK(body == expected);
    CHECK(bodyOf(bench.describe()) == expected);
    hardware.readings[0] = {-5, 1.5f, 0.25f, 30.0f, hbot::IndexSeen};
    const Answer answer = bench.push();
    CHECK(answer.sequence == bench.sequence);
    REQUIRE(answer.readings.size() == 2);
    CHECK(answer.readings[0].count == -5);
    CHECK(answer.readings[0].rate == 1.5f);
    CHECK(answer.readings[0].current == 0.25f);
    CHECK(answer.readings[0].temperature == 30.0f);
    CHECK(answer.readings[0].flags == hbot::IndexSeen);
    CHECK(hardware.reads == 1);
    bench.pass(100);
    CHECK(bench.feed(Bytes(5, 0)).empty());
}

TEST_CASE("conversation: bits without a name are sent as 0") {
    Bench bench;
    hardware.readings[0].flags = 0xFFF8 | hbot::IndexSeen;
    CHECK(bench.push().readings[0].flags == hbot::IndexSeen);
}

TEST_CASE("conversation: a name of more than 32 bytes is cut") {
    hbot::Device<2> device("0123456789012345678901234567890123456789", joints, readJoints,
                           driveJoints);
    size_t length = 0;
    for (uint8_t byte : page().vectors.at("describe").at("frame")) {
        length = device.receive(byte, 0);
    }
    const Bytes body = bodyOf(Bytes(device.answer(), device.answer() + length));
    CHECK(body[2] == 32);
    CHECK(body[2 + 32] == '1');
    CHECK(body[2 + 33] == 2);
}

TEST_CASE("conversation: a port is served, and only the bytes that had arrived are taken") {
    struct Port {
        Bytes in, out;
        size_t next = 0;
        int available() const { return static_cast<int>(in.size() - next); }
        int read() {
            in.push_back(0); // A line that is never silent.
            return in[next++];
        }
        int availableForWrite() const { return 64; }
        void write(const uint8_t *bytes, size_t length) {
            out.insert(out.end(), bytes, bytes + length);
        }
    } port;
    Bench bench;
    port.in = commandFrame(7, true, 20, {0.25f, -0.125f});
    const size_t arrived = port.in.size();
    bench.device.serve(port, bench.nowUs);
    CHECK(port.next == arrived);
    CHECK(decoded(port.out).sequence == 7);
    CHECK(pushes());
    bench.nowUs += 20000;
    port.in.clear();
    port.next = 0;
    bench.device.serve(port, bench.nowUs);
    CHECK(isFree());
}

TEST_CASE("duty 2: a host that stops reading cannot keep torque on") {
    struct Port {
        Bench &bench;
        Bytes in, out;
        size_t next, room;
        int available() const { return static_cast<int>(in.size() - next); }
        int read() { return in[next++]; }
        int availableForWrite() const { return static_cast<int>(room); }
        // Waits for the host if there is no room, as the `Serial` of a board does.
        void write(const uint8_t *bytes, size_t length) {
            bench.nowUs += length > room ? 20000 : 0;
            room -= length > room ? room : length;
            out.insert(out.end(), bytes, bytes + length);
        }
    };
    Bench bench;
    Port port = {bench, {}, {}, 0, 10};
    for (uint32_t sequence = 1; sequence <= 5; sequence++) {
        const Bytes frame = commandFrame(sequence, true, 20, {0.25f, -0.125f});
        port.in.insert(port.in.end(), frame.begin(), frame.end());
    }
    const uint32_t startUs = bench.nowUs;
    bench.device.serve(port, bench.nowUs);
    CHECK(bench.nowUs == startUs);
    CHECK(port.next == port.in.size() / 5);
    CHECK(port.out.size() == 10);
    CHECK(bench.device.isSending());
    CHECK(pushes());
    bench.nowUs = startUs + 20000;
    bench.device.serve(port, bench.nowUs);
    CHECK(isFree());
    // The host reads again: every answer is whole, and no waiting command brings torque back.
    for (int i = 0; i < 100; i++) {
        port.room = 7;
        bench.device.serve(port, bench.nowUs);
        CHECK(isFree());
    }
    uint32_t sequence = 0;
    for (size_t begin = 0, end = 0; end < port.out.size(); end++) {
        if (port.out[end] == 0) {
            const auto from = port.out.begin();
            const Bytes frame(from + static_cast<long>(begin), from + static_cast<long>(end + 1));
            CHECK(decoded(frame).sequence == ++sequence);
            begin = end + 1;
        }
    }
    CHECK(sequence == 5);
}

TEST_CASE("duty 1: a command with another number of torques is not applied or answered") {
    for (const std::vector<float> &torque :
         {std::vector<float>{}, std::vector<float>{0.5f}, std::vector<float>{0.5f, 0.5f, 0.5f}}) {
        Bench bench;
        bench.push();
        CHECK_FALSE(bench.command(true, torque).any);
        CHECK_FALSE(bench.command(false, torque).any);
        CHECK(pushes());
    }
}

TEST_CASE("duty 1: a command with a torque that is not finite is not applied or answered") {
    for (float bad : {NotANumber, Infinite, -Infinite}) {
        Bench bench;
        bench.push();
        CHECK_FALSE(bench.command(true, {0.5f, bad}).any);
        CHECK_FALSE(bench.command(true, {bad, 0.5f}).any);
        CHECK(pushes());
    }
}

TEST_CASE("duty 1: a damaged frame is not applied or answered, whichever bit is damaged") {
    Bench bench;
    bench.push();
    const Bytes frame = commandFrame(77, true, 20, {0.5f, 0.5f});
    for (size_t bit = 0; bit < 8 * (frame.size() - 1); bit++) {
        Bytes damaged = frame;
        damaged[bit / 8] = static_cast<uint8_t>(damaged[bit / 8] ^ (1u << (bit % 8)));
        CHECK(bench.feed(damaged).empty());
        CHECK(pushes());
    }
    CHECK(bench.device.refused() >= 8 * (frame.size() - 1));
}

TEST_CASE("duty 1: invalid commands, a Describe and noise do not restart the watchdog") {
    Bench bench;
    bench.push();
    for (int ms = 0; ms < 19; ms++) {
        bench.pass(1);
        bench.command(true, {0.5f});
        bench.command(true, {NotANumber, 0.5f});
        bench.feed({1, 2, 3, 0});
        bench.describe();
        CHECK(pushes());
    }
    bench.pass(1);
    CHECK(isFree());
}

TEST_CASE("duty 2: the watchdog ends torque when its time has passed, and not before") {
    Bench bench;
    bench.push();
    bench.nowUs += 19999;
    bench.device.poll(bench.nowUs);
    CHECK(pushes());
    bench.nowUs += 1;
    bench.device.poll(bench.nowUs);
    CHECK(isFree());
    CHECK(bench.device.flags() == hbot::WatchdogExpired);
}

TEST_CASE("duty 2: each valid command restarts the watchdog with its own time") {
    Bench bench;
    for (int i = 0; i < 10; i++) {
        bench.push();
        bench.pass(19);
        CHECK(pushes());
    }
    bench.command(true, {0.25f, -0.125f}, 65535);
    bench.pass(65534);
    CHECK(pushes());
    bench.pass(1);
    CHECK(isFree());
}

TEST_CASE("duty 2: the watchdog works when the microseconds wrap") {
    Bench bench(true, 0xFFFFFFFFu - 9999u);
    bench.push();
    bench.pass(19);
    CHECK(pushes());
    bench.pass(1);
    CHECK(isFree());
}

TEST_CASE("duty 2: a watchdog time of 0 has expired at once") {
    Bench bench;
    const Answer answer = bench.command(true, {0.25f, -0.125f}, 0);
    CHECK(answer.flags == hbot::WatchdogExpired);
    CHECK(isFree());
}

TEST_CASE("duty 2: after it, commands are answered without torque until one with enable false") {
    Bench bench;
    bench.push();
    bench.pass(20);
    for (int i = 0; i < 50; i++) {
        const Answer answer = bench.push();
        CHECK(answer.sequence == bench.sequence);
        CHECK(answer.flags == hbot::WatchdogExpired);
        CHECK(isFree());
    }
    CHECK(bench.release().flags == 0);
    CHECK(isFree());
    CHECK(bench.push().flags == hbot::Enabled);
    CHECK(pushes());
}

TEST_CASE("duty 2: a command that comes too late does not bring torque back") {
    Bench bench;
    bench.push();
    // No poll in between: the loop of the controller stood still.
    bench.nowUs += 20000;
    CHECK(bench.push().flags == hbot::WatchdogExpired);
    CHECK(isFree());
}

TEST_CASE("duty 2: it also expires while the joints are free") {
    Bench bench;
    bench.release();
    bench.pass(20);
    CHECK(bench.device.flags() == hbot::WatchdogExpired);
    CHECK(bench.push().flags == hbot::WatchdogExpired);
    CHECK(isFree());
}

TEST_CASE("enable false: the joints are free of torque, whatever the torques are") {
    Bench bench;
    CHECK(bench.push().flags == hbot::Enabled);
    CHECK(bench.command(false, {0.25f, -0.125f}).flags == 0);
    CHECK(isFree());
}

TEST_CASE("duty 3: after boot the torque is zero") {
    Bench bench(false);
    CHECK(hardware.drives == 1);
    CHECK(isFree());
    bench.pass(100);
    CHECK(isFree());
    CHECK(bench.device.flags() == hbot::Undescribed);
}

TEST_CASE("duty 3: before a Describe, commands are answered without torque") {
    Bench bench(false);
    for (int i = 0; i < 5; i++) {
        const Answer answer = bench.push();
        CHECK(answer.sequence == bench.sequence);
        CHECK(answer.flags == hbot::Undescribed);
        CHECK(isFree());
    }
    bench.describe();
    CHECK(bench.push().flags == hbot::Enabled);
    CHECK(pushes());
}

TEST_CASE("duty 4: a fault ends torque at once and is reported") {
    Bench bench;
    bench.push();
    bench.device.setCondition(hbot::Condition::Fault);
    CHECK(isFree());
    CHECK(bench.push().flags == hbot::Fault);
    CHECK(isFree());
}

TEST_CASE("duty 4: a fault that is found while the joints are driven ends torque") {
    static hbot::Device<2> *found;
    struct Faulty {
        static void drive(const float *torque, bool on) {
            if (on) {
                found->setCondition(hbot::Condition::Fault);
            }
            driveJoints(torque, on);
        }
    };
    hardware = Hardware();
    hbot::Device<2> device("duties 1.0", joints, readJoints, Faulty::drive);
    found = &device;
    device.begin();
    for (const Bytes &frame : {page().vectors.at("describe").at("frame"),
                               commandFrame(1, true, 20, {0.25f, -0.125f})}) {
        for (uint8_t byte : frame) {
            device.receive(byte, 0);
        }
    }
    CHECK(device.flags() == hbot::Fault);
    CHECK(isFree());
}

TEST_CASE("duty 4: it stays until its cause is gone and then a command with enable false comes") {
    Bench bench;
    bench.push();
    bench.device.setCondition(hbot::Condition::Fault);
    CHECK(bench.release().flags == hbot::Fault);
    CHECK(bench.push().flags == hbot::Fault);
    bench.device.setCondition(hbot::Condition::Ready);
    CHECK(bench.push().flags == hbot::Fault);
    CHECK(isFree());
    CHECK(bench.release().flags == 0);
    CHECK(bench.push().flags == hbot::Enabled);
    CHECK(pushes());
}

TEST_CASE("duty 4: a fault that ends between two commands is reported all the same") {
    Bench bench;
    bench.push();
    bench.device.setCondition(hbot::Condition::Fault);
    bench.device.setCondition(hbot::Condition::Ready);
    CHECK(bench.push().flags == hbot::Fault);
    CHECK(isFree());
}

TEST_CASE("duty 4: a power stage that is not ready is driven, but not reported as enabled") {
    Bench bench;
    bench.device.setCondition(hbot::Condition::NotReady);
    CHECK(bench.push().flags == 0);
    CHECK(pushes());
    bench.device.setCondition(hbot::Condition::Ready);
    CHECK(bench.push().flags == hbot::Enabled);
}

TEST_CASE("duty 5: no torque beyond the peak of a joint, and the reading says so") {
    Bench bench;
    Answer answer = bench.command(true, {3.0f, -3.0f});
    CHECK(hardware.torque[0] == 1.0f);
    CHECK(hardware.torque[1] == -0.5f);
    CHECK(answer.readings[0].flags == hbot::OverCurrent);
    CHECK(answer.readings[1].flags == hbot::OverCurrent);
    answer = bench.command(true, {1.0f, 0.5f});
    CHECK(hardware.torque[0] == 1.0f);
    CHECK(answer.readings[0].flags == 0);
}

TEST_CASE("duty 5: a peak torque below zero or not a number gives no torque") {
    const hbot::Joint wrong[] = {{4096, -0.1f, 80.0f}, {8192, NotANumber, 0.0f}};
    hardware = Hardware();
    hbot::Device<2> device("duties 1.0", wrong, readJoints, driveJoints);
    for (float sign : {1.0f, -1.0f}) {
        for (const Bytes &frame : {page().vectors.at("describe").at("frame"),
                                   commandFrame(1, true, 20, {0.25f * sign, 0.25f * sign})}) {
            for (uint8_t byte : frame) {
                device.receive(byte, 0);
            }
        }
        CHECK(hardware.on);
        CHECK(hardware.torque[0] == 0.0f);
        CHECK(hardware.torque[1] == 0.0f);
    }
}

TEST_CASE("duty 5: a joint that is too hot has no torque, and the reading says so") {
    for (float hot : {80.0f, 200.0f, Infinite, NotANumber}) {
        Bench bench;
        hardware.readings[0].temperature = hot;
        // The second joint does not measure its temperature, and goes on.
        hardware.readings[1].temperature = 0.0f;
        const Answer answer = bench.push();
        CHECK(hardware.torque[0] == 0.0f);
        CHECK(hardware.torque[1] == -0.125f);
        CHECK(answer.readings[0].flags == hbot::OverTemperature);
        CHECK(answer.readings[1].flags == 0);
    }
}

TEST_CASE("duty 5: what the hardware itself reports is passed on") {
    Bench bench;
    hardware.readings[0].flags = hbot::OverCurrent | hbot::OverTemperature;
    CHECK(bench.push().readings[0].flags == (hbot::OverCurrent | hbot::OverTemperature));
}
