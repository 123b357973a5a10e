// The motor controller's side of hbot's serial link, in one header.
//
// The page docs/link.md of hbot is the contract: frames, messages, and the five duties that keep
// people safe. This header fulfils the duties. The builder of a controller writes two functions:
// one reads the joints, the other drives them.
//
//     #include <HbotLink.h>
//
//     const hbot::Joint joints[] = {{16384, 0.93f, 80.0f}, {16384, 0.14f, 80.0f}};
//     void readJoints(hbot::Reading *readings) { ... }
//     void driveJoints(const float *torque, bool on) { ... }
//     hbot::Device<2> device("my firmware 1.0", joints, readJoints, driveJoints);
//
//     void setup() { Serial.begin(3000000); device.begin(); }
//     void loop() { device.serve(Serial, micros()); }
//
// From the line upwards: `FrameWriter` and `Decoder` turn messages into bytes and back. `Device`
// holds the state of the controller. It is fed bytes and the time in microseconds, and it neither
// waits nor allocates memory. Call all functions of a device from one context: either the main loop
// or one interrupt.
//
// C++11, without heap, standard library, exceptions or virtual functions.

#ifndef HBOT_LINK_H
#define HBOT_LINK_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace hbot {

// Version of the serial protocol that this header speaks.
constexpr uint16_t ProtocolVersion = 1;
// Largest number of joints of a port.
constexpr uint8_t MaxJoints = 16;
// Largest length of the firmware's name, in bytes of UTF-8.
constexpr uint8_t MaxFirmwareBytes = 32;

// Flags of a controller, in a feedback.
constexpr uint16_t Enabled = 0x0001;
constexpr uint16_t WatchdogExpired = 0x0002;
constexpr uint16_t Fault = 0x0004;
constexpr uint16_t Undescribed = 0x0008;

// Flags of a joint, in its reading.
constexpr uint16_t IndexSeen = 0x0001;
constexpr uint16_t OverCurrent = 0x0002;
constexpr uint16_t OverTemperature = 0x0004;

// What the builder states about a joint.
struct Joint {
    // Encoder counts in one turn of the encoder, before the gear; 1 or more.
    uint32_t countsPerTurn;
    // Largest torque at the joint, after the gear, N m. The device clips a command that asks for
    // more, and sets `OverCurrent`. 0 for a joint without a motor.
    float peakTorque;
    // Temperature from which on the joint gets no torque and has `OverTemperature` set, in degrees
    // Celsius. 0 if the temperature is not measured.
    float maxTemperature;
};

// The reading of one joint. Positive rates, currents and torques are towards greater counts.
struct Reading {
    // Position of the encoder, before the gear, in counts. It wraps at 32 bits.
    int32_t count;
    // Rate of the joint, after the gear, rad/s.
    float rate;
    // Motor current, A. 0 if it is not measured.
    float current;
    // Temperature of the motor, degrees Celsius. 0 if it is not measured.
    float temperature;
    // `IndexSeen`, `OverCurrent` and `OverTemperature`, as far as the hardware reports them.
    uint16_t flags;
};

// Whether the hardware of a controller can apply torques.
enum class Condition : uint8_t {
    // The motors give the torques that they are driven with.
    Ready,
    // The power stage gives no torque, although nothing is broken: it starts, or its supply is off.
    // The device does not report `Enabled`. The host has a fault after 20 ms of this while it
    // commands torque.
    NotReady,
    // A driver, the supply, an encoder or the temperature has a fault.
    Fault
};

// The torques of one tick, as the host sends them.
struct Command {
    uint32_t sequence;
    bool enable;
    uint16_t watchdogMs;
    // Number of torques; any number up to `MaxJoints`.
    uint8_t joints;
    // Torque at each joint, after the gear, N m. Any bit pattern, also NaN.
    float torque[MaxJoints];
};

// Returns the length of the longest frame whose body has `body` bytes, with CRC and delimiter.
constexpr size_t frameBytes(size_t body) { return body + 4 + (body + 4 + 253) / 254 + 1; }
constexpr size_t commandFrameBytes(size_t joints) { return frameBytes(11 + 4 * joints); }
constexpr size_t feedbackFrameBytes(size_t joints) { return frameBytes(10 + 20 * joints); }
constexpr size_t descriptionFrameBytes(size_t joints) {
    return frameBytes(6 + MaxFirmwareBytes + 5 * joints);
}

namespace detail {

constexpr uint32_t crcSteps(uint32_t crc, int bits) {
    return bits == 0 ? crc : crcSteps((crc >> 1) ^ ((crc & 1u) != 0 ? 0xEDB88320u : 0u), bits - 1);
}

#define HBOT_LINK_CRC_4(n, bits) \
    crcSteps(n, bits), crcSteps(n + 1, bits), crcSteps(n + 2, bits), crcSteps(n + 3, bits)
#define HBOT_LINK_CRC_16(n, bits)                           \
    HBOT_LINK_CRC_4(n, bits), HBOT_LINK_CRC_4(n + 4, bits), \
        HBOT_LINK_CRC_4(n + 8, bits), HBOT_LINK_CRC_4(n + 12, bits)
#define HBOT_LINK_CRC_64(n)                                 \
    HBOT_LINK_CRC_16(n, 8), HBOT_LINK_CRC_16(n + 16, 8),    \
        HBOT_LINK_CRC_16(n + 32, 8), HBOT_LINK_CRC_16(n + 48, 8)

// Adds one byte to a CRC-32/ISO-HDLC. A CRC begins with 0xFFFFFFFF and is inverted at the end. The
// table has 16 entries (64 bytes). With `HBOT_LINK_CRC_TABLE_256` defined it has 256 (1 KiB), and a
// byte takes one step instead of two.
inline uint32_t crcAdd(uint32_t crc, uint8_t byte) {
#ifdef HBOT_LINK_CRC_TABLE_256
    static constexpr uint32_t table[256] = {HBOT_LINK_CRC_64(0), HBOT_LINK_CRC_64(64),
                                            HBOT_LINK_CRC_64(128), HBOT_LINK_CRC_64(192)};
    return (crc >> 8) ^ table[(crc ^ byte) & 0xFFu];
#else
    static constexpr uint32_t table[16] = {HBOT_LINK_CRC_16(0, 4)};
    crc = (crc >> 4) ^ table[(crc ^ byte) & 0xFu];
    return (crc >> 4) ^ table[(crc ^ (static_cast<uint32_t>(byte) >> 4)) & 0xFu];
#endif
}

#undef HBOT_LINK_CRC_64
#undef HBOT_LINK_CRC_16
#undef HBOT_LINK_CRC_4

inline uint32_t crc(const uint8_t *bytes, size_t length) {
    uint32_t sum = 0xFFFFFFFFu;
    for (size_t i = 0; i < length; i++) {
        sum = crcAdd(sum, bytes[i]);
    }
    return ~sum;
}

inline uint32_t bitsOf(float value) {
    static_assert(sizeof(float) == 4, "the link carries IEEE 754 singles");
    uint32_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

inline float floatOf(uint32_t bits) {
    float value = 0.0f;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// Looks at the bits, so that it also works with -ffast-math.
inline bool isFinite(float value) { return (bitsOf(value) & 0x7F800000u) != 0x7F800000u; }

// Reads the body of a frame from its start.
class Reader {
public:
    Reader(const uint8_t *bytes, size_t length) : bytes_(bytes), left_(length) {}

    bool atEnd() const { return left_ == 0; }

    bool byte(uint8_t &value) {
        if (left_ == 0) {
            return false;
        }
        value = *bytes_++;
        left_--;
        return true;
    }

    // Reads a varint of an unsigned integer with `width` bits. Refuses a greater one.
    template <typename Integer> bool varint(Integer &value) {
        constexpr unsigned width = 8 * sizeof(Integer);
        value = 0;
        for (unsigned shift = 0; shift < width; shift += 7) {
            uint8_t next = 0;
            if (!byte(next) || (width - shift < 8 && next >> (width - shift) != 0)) {
                return false;
            }
            value = static_cast<Integer>(value | static_cast<Integer>(next & 0x7Fu) << shift);
            if ((next & 0x80u) == 0) {
                return true;
            }
        }
        return false;
    }

    bool real(float &value) {
        uint32_t bits = 0;
        for (unsigned shift = 0; shift < 32; shift += 8) {
            uint8_t next = 0;
            if (!byte(next)) {
                return false;
            }
            bits |= static_cast<uint32_t>(next) << shift;
        }
        value = floatOf(bits);
        return true;
    }

private:
    const uint8_t *bytes_;
    size_t left_;
};

} // namespace detail

// What a byte from the line has completed. The last five are reasons to refuse a frame; they have
// the names of docs/link.md.
enum class Heard : uint8_t { Nothing, Describe, Command, TooLong, Cobs, TooShort, Crc, Body };

// Collects bytes from the line up to each delimiter and decodes the messages to the controller.
class Decoder {
public:
    // Takes one byte. If it completes a command, `command` has it until the next call.
    Heard push(uint8_t byte) {
        if (byte == 0) {
            return finish();
        }
        if (skipping_) {
            return Heard::Nothing;
        }
        if (length_ == sizeof frame_) {
            skipping_ = true;
            return Heard::TooLong;
        }
        frame_[length_++] = byte;
        return Heard::Nothing;
    }

    // Returns the last command that was decoded.
    const Command &command() const { return command_; }

private:
    Heard finish() {
        const size_t length = length_;
        const bool hadItsResult = skipping_ || length == 0;
        length_ = 0;
        skipping_ = false;
        return hadItsResult ? Heard::Nothing : decode(length);
    }

    Heard decode(size_t stuffed) {
        size_t length = 0;
        if (!unstuff(stuffed, length)) {
            return Heard::Cobs;
        }
        if (length < 5) {
            return Heard::TooShort;
        }
        const size_t body = length - 4;
        const uint32_t sum = detail::crc(frame_, body);
        for (unsigned i = 0; i < 4; i++) {
            if (frame_[body + i] != static_cast<uint8_t>(sum >> (8 * i))) {
                return Heard::Crc;
            }
        }
        return message(detail::Reader(frame_, body));
    }

    // Decodes COBS in place. Returns false if a code points past the end.
    bool unstuff(size_t end, size_t &length) {
        size_t from = 0;
        while (from < end) {
            const uint8_t code = frame_[from++];
            if (from + code - 1u > end) {
                return false;
            }
            for (uint8_t i = 1; i < code; i++) {
                frame_[length++] = frame_[from++];
            }
            if (code != 0xFF && from < end) {
                frame_[length++] = 0;
            }
        }
        return true;
    }

    Heard message(detail::Reader body) {
        uint32_t number = 0;
        if (!body.varint(number)) {
            return Heard::Body;
        }
        if (number == 0) {
            return body.atEnd() ? Heard::Describe : Heard::Body;
        }
        return number == 1 && fields(body) && body.atEnd() ? Heard::Command : Heard::Body;
    }

    bool fields(detail::Reader &body) {
        uint8_t enable = 0;
        uint64_t joints = 0;
        if (!body.varint(command_.sequence) || !body.byte(enable) || enable > 1 ||
            !body.varint(command_.watchdogMs) || !body.varint(joints) || joints > MaxJoints) {
            return false;
        }
        command_.enable = enable == 1;
        command_.joints = static_cast<uint8_t>(joints);
        for (uint8_t j = 0; j < command_.joints; j++) {
            if (!body.real(command_.torque[j])) {
                return false;
            }
        }
        return true;
    }

    // The bytes since the last delimiter; the delimiter itself is not stored.
    uint8_t frame_[commandFrameBytes(MaxJoints) - 1] = {};
    size_t length_ = 0;
    bool skipping_ = false;
    Command command_ = {};
};

// Writes a frame into a buffer: body, CRC, COBS and the delimiter in one pass. The buffer must be
// as long as the longest frame of the message.
class FrameWriter {
public:
    explicit FrameWriter(uint8_t *buffer) : buffer_(buffer) {}

    void byte(uint8_t value) {
        sum_ = detail::crcAdd(sum_, value);
        stuff(value);
    }

    void varint(uint32_t value) {
        while (value >= 0x80u) {
            byte(static_cast<uint8_t>(value | 0x80u));
            value >>= 7;
        }
        byte(static_cast<uint8_t>(value));
    }

    void zigzag(int32_t value) {
        const uint32_t twice = static_cast<uint32_t>(value) << 1;
        varint(value < 0 ? ~twice : twice);
    }

    void real(float value) {
        const uint32_t bits = detail::bitsOf(value);
        for (unsigned shift = 0; shift < 32; shift += 8) {
            byte(static_cast<uint8_t>(bits >> shift));
        }
    }

    // Ends the frame and returns its length in bytes.
    size_t finish() {
        const uint32_t sum = ~sum_;
        for (unsigned shift = 0; shift < 32; shift += 8) {
            stuff(static_cast<uint8_t>(sum >> shift));
        }
        if (!full_) {
            buffer_[code_] = static_cast<uint8_t>(length_ - code_);
        }
        buffer_[length_++] = 0;
        return length_;
    }

private:
    void stuff(uint8_t value) {
        // A run of 254 bytes has its code already. The next run begins only if a byte follows.
        if (full_) {
            code_ = length_++;
            full_ = false;
        }
        if (value != 0) {
            buffer_[length_++] = value;
            full_ = length_ - code_ == 0xFF;
        }
        if (value == 0 || full_) {
            buffer_[code_] = static_cast<uint8_t>(length_ - code_);
        }
        if (value == 0) {
            code_ = length_++;
        }
    }

    uint8_t *buffer_;
    // Place of the code byte of the present run, and number of bytes written.
    size_t code_ = 0;
    size_t length_ = 1;
    bool full_ = false;
    uint32_t sum_ = 0xFFFFFFFFu;
};

// Writes a `Description` frame to `buffer`, which has `descriptionFrameBytes(count)` bytes. A name
// of more than 32 bytes is cut; use ASCII, so that no character is cut in two. Returns the length.
inline size_t encodeDescription(const char *firmware, const Joint *joints, uint8_t count,
                                uint8_t *buffer) {
    FrameWriter frame(buffer);
    frame.byte(0);
    frame.varint(ProtocolVersion);
    uint8_t length = 0;
    while (length < MaxFirmwareBytes && firmware[length] != '\0') {
        length++;
    }
    frame.varint(length);
    for (uint8_t i = 0; i < length; i++) {
        frame.byte(static_cast<uint8_t>(firmware[i]));
    }
    frame.varint(count);
    for (uint8_t j = 0; j < count; j++) {
        frame.varint(joints[j].countsPerTurn);
    }
    return frame.finish();
}

// Writes a `Feedback` frame to `buffer`, which has `feedbackFrameBytes(count)` bytes. Returns the
// length.
inline size_t encodeFeedback(uint32_t sequence, uint16_t flags, const Reading *readings,
                             uint8_t count, uint8_t *buffer) {
    FrameWriter frame(buffer);
    frame.byte(1);
    frame.varint(sequence);
    frame.varint(flags);
    frame.varint(count);
    for (uint8_t j = 0; j < count; j++) {
        frame.zigzag(readings[j].count);
        frame.real(readings[j].rate);
        frame.real(readings[j].current);
        frame.real(readings[j].temperature);
        frame.varint(readings[j].flags);
    }
    return frame.finish();
}

// A motor controller with `N` joints, as docs/link.md describes it.
template <uint8_t N> class Device {
    static_assert(N >= 1 && N <= MaxJoints, "a port has 1 to 16 joints");

public:
    // Samples all joints, as close to one instant as possible, and writes N readings. It is called
    // for each valid command.
    typedef void (*Read)(Reading *readings);
    // Drives all joints with N torques at the joint, after the gear, N m. If `on` is false, all
    // torques are 0 and the power stages can be switched off. It is called for each valid command,
    // and at once when torque must end.
    typedef void (*Drive)(const float *torque, bool on);

    // `firmware` is the name and version for people to read, up to 32 bytes of ASCII. It must
    // outlive the device.
    Device(const char *firmware, const Joint (&joints)[N], Read read, Drive drive)
        : firmware_(firmware), read_(read), drive_(drive) {
        for (uint8_t j = 0; j < N; j++) {
            joints_[j] = joints[j];
            // Also true for NaN. Without this, a negative peak would turn a torque round.
            if (!(joints_[j].peakTorque > 0.0f)) {
                joints_[j].peakTorque = 0.0f;
            }
        }
    }

    // Returns whether a part of an answer waits until the port takes it. `serve` sends it in the
    // next calls, so do not sleep meanwhile.
    bool isSending() const { return unsent_ > 0; }

    // Sets the joints to zero torque. Call it once, after the drivers of the motors are ready.
    void begin() { release(); }

    // Checks the watchdog at the time `nowUs`, in microseconds; the time wraps at 32 bits. Call it
    // at least once in a millisecond: if no call comes, torque does not end.
    void poll(uint32_t nowUs) {
        watch(nowUs);
        if (on_ && !givesTorque()) {
            release();
        }
    }

    // Takes one byte from the line. `nowUs` is the time of this call. Returns the number of bytes in
    // `answer()` that must be sent now; it is 0 if there is no answer. Checks the watchdog too.
    size_t receive(uint8_t byte, uint32_t nowUs) {
        poll(nowUs);
        switch (decoder_.push(byte)) {
        case Heard::Nothing:
            return 0;
        case Heard::Describe:
            described_ = true;
            return encodeDescription(firmware_, joints_, N, answer_);
        case Heard::Command:
            return isValid(decoder_.command()) ? obey(decoder_.command(), nowUs) : 0;
        default:
            refused_++;
            return 0;
        }
    }

    // Returns the answer that the last call of `receive` has made.
    const uint8_t *answer() const { return answer_; }

    // Takes the bytes that have arrived on `port` and sends the answers. `port` is a `Serial` of
    // Arduino, or any type with `available`, `read`, `availableForWrite` and `write`. Call it in
    // each pass of the loop with `micros()`. A host that stops reading cannot hold this function
    // up: it writes only what the port takes at once, and takes no byte until the answer is out.
    template <typename Port> void serve(Port &port, uint32_t nowUs) {
        poll(nowUs);
        // Bytes that arrive meanwhile wait for the next call, so a line that is never silent cannot
        // keep the loop here.
        send(port);
        for (int waiting = port.available(); waiting > 0 && unsent_ == 0; waiting--) {
            unsent_ = receive(static_cast<uint8_t>(port.read()), nowUs);
            sent_ = 0;
            send(port);
        }
    }

    // Reports the present condition of the hardware; it is `Ready` at boot. A fault ends torque at
    // once. It stays until another condition is reported and then a command with `enable` false
    // comes. Not for an interrupt: there, set a volatile bool and report it in the loop.
    void setCondition(Condition condition) {
        ready_ = condition != Condition::NotReady;
        faultPresent_ = condition == Condition::Fault;
        if (faultPresent_ && !fault_) {
            fault_ = true;
            release();
        }
    }

    // Returns the controller flags of docs/link.md.
    uint16_t flags() const {
        return static_cast<uint16_t>(
            (givesTorque() && ready_ ? Enabled : 0) | (expired_ ? WatchdogExpired : 0) |
            (fault_ ? Fault : 0) | (described_ ? 0 : Undescribed));
    }

    // Returns the number of frames that were refused since boot. It wraps.
    uint32_t refused() const { return refused_; }

private:
    // Sends what the port takes without waiting: the host can stop reading at any time, and the
    // watchdog must not wait for it.
    template <typename Port> void send(Port &port) {
        const int room = port.availableForWrite();
        const size_t free = room > 0 ? static_cast<size_t>(room) : 0;
        const size_t piece = free < unsent_ ? free : unsent_;
        if (piece > 0) {
            port.write(answer_ + sent_, piece);
            sent_ += piece;
            unsent_ -= piece;
        }
    }

    bool givesTorque() const { return enable_ && !expired_ && !fault_ && described_; }

    void release() {
        const float zero[N] = {};
        on_ = false;
        drive_(zero, false);
    }

    void watch(uint32_t nowUs) {
        if (commanded_ && nowUs - commandUs_ >= watchdogUs_) {
            expired_ = true;
        }
    }

    static bool isValid(const Command &command) {
        bool valid = command.joints == N;
        for (uint8_t j = 0; j < command.joints; j++) {
            valid = valid && detail::isFinite(command.torque[j]);
        }
        return valid;
    }

    size_t obey(const Command &command, uint32_t nowUs) {
        if (!command.enable) {
            expired_ = false;
            fault_ = faultPresent_;
        }
        enable_ = command.enable;
        commanded_ = true;
        commandUs_ = nowUs;
        watchdogUs_ = static_cast<uint32_t>(command.watchdogMs) * 1000u;
        watch(nowUs); // A time of 0 has expired now.

        Reading readings[N] = {};
        read_(readings);
        float torque[N];
        for (uint8_t j = 0; j < N; j++) {
            torque[j] = limited(command, j, readings[j]);
        }
        if (givesTorque()) {
            on_ = true;
            drive_(torque, true);
        }
        // Not `else`: `drive_` may have reported a fault.
        if (!givesTorque()) {
            release();
        }
        return encodeFeedback(command.sequence, flags(), readings, N, answer_);
    }

    // Returns the torque of a joint within its limits, N m, and sets the flags of its reading.
    float limited(const Command &command, uint8_t j, Reading &reading) const {
        const Joint &joint = joints_[j];
        float torque = command.torque[j];
        if (command.enable && !(torque <= joint.peakTorque && torque >= -joint.peakTorque)) {
            torque = torque > 0.0f ? joint.peakTorque : -joint.peakTorque;
            reading.flags = static_cast<uint16_t>(reading.flags | OverCurrent);
        }
        if (joint.maxTemperature != 0.0f && !(reading.temperature < joint.maxTemperature)) {
            torque = 0.0f;
            reading.flags = static_cast<uint16_t>(reading.flags | OverTemperature);
        }
        reading.flags = reading.flags & (IndexSeen | OverCurrent | OverTemperature);
        return torque;
    }

    static constexpr size_t AnswerBytes = feedbackFrameBytes(N) > descriptionFrameBytes(N)
                                              ? feedbackFrameBytes(N)
                                              : descriptionFrameBytes(N);

    const char *firmware_;
    Joint joints_[N];
    Read read_;
    Drive drive_;
    Decoder decoder_;
    uint8_t answer_[AnswerBytes] = {};
    // Bytes of the answer that the port has and has not taken.
    size_t sent_ = 0;
    size_t unsent_ = 0;
    uint32_t refused_ = 0;
    // Time of the last valid command, if there was one since boot, and its watchdog time.
    uint32_t commandUs_ = 0;
    uint32_t watchdogUs_ = 0;
    bool commanded_ = false;
    bool enable_ = false;
    // True from a call of `drive_` with torque until the next without.
    bool on_ = false;
    bool expired_ = false;
    bool described_ = false;
    bool ready_ = true;
    bool fault_ = false;
    bool faultPresent_ = false;
};

} // namespace hbot

#endif
