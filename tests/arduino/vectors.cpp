// The header against the bytes of docs/link.md, in both directions.
#include <HbotLink.h>
#include <cfloat>
#include <climits>
#include <doctest/doctest.h>
#include <set>

#include "page.h"

namespace {

Bytes bytesOf(const uint8_t *bytes, size_t length) { return Bytes(bytes, bytes + length); }

// Returns what each byte completes, without the bytes that complete nothing.
std::vector<hbot::Heard> heard(hbot::Decoder &decoder, const Bytes &bytes) {
    std::vector<hbot::Heard> all;
    for (uint8_t byte : bytes) {
        const hbot::Heard one = decoder.push(byte);
        if (one != hbot::Heard::Nothing) {
            all.push_back(one);
        }
    }
    return all;
}

// Returns `body` as the header frames it.
Bytes framed(const Bytes &body) {
    Bytes buffer(hbot::frameBytes(body.size()));
    hbot::FrameWriter frame(buffer.data());
    for (uint8_t byte : body) {
        frame.byte(byte);
    }
    buffer.resize(frame.finish());
    return buffer;
}

Bytes feedback(uint32_t sequence, uint16_t flags, const std::vector<hbot::Reading> &readings) {
    const uint8_t count = static_cast<uint8_t>(readings.size());
    Bytes buffer(hbot::feedbackFrameBytes(count));
    buffer.resize(hbot::encodeFeedback(sequence, flags, readings.data(), count, buffer.data()));
    return buffer;
}

// The commands of the page, field by field.
struct Known {
    uint32_t sequence;
    bool enable;
    std::vector<float> torque;
};

std::map<std::string, Known> commands() {
    return {{"command_disable", {0, false, {0.0f, 0.0f, 0.0f, 0.0f}}},
            {"command_enable", {1000, true, {0.25f, -0.5f, 1.0f, -0.0625f}}},
            {"command_wrap", {4294967295u, true, {FLT_MIN, FLT_MAX}}}};
}

// The frames that the header must make for the messages that the page describes.
std::map<std::string, Bytes> answers() {
    std::map<std::string, Bytes> all;
    const hbot::Joint joints[] = {
        {65536, 1, 0}, {65536, 1, 0}, {8192, 1, 0}, {8192, 1, 0}};
    Bytes description(hbot::descriptionFrameBytes(4));
    description.resize(hbot::encodeDescription("example 1.0.0", joints, 4, description.data()));
    all["description"] = description;
    all["feedback_after_boot"] = feedback(0, hbot::Undescribed, {{0, 0, 0, 21.5f, 0}});
    all["feedback_enabled"] =
        feedback(1000, hbot::Enabled,
                 {{1, 0.5f, 0.125f, 24, hbot::IndexSeen},
                  {-1, -0.5f, -0.25f, 24.5f, hbot::IndexSeen},
                  {INT32_MAX, 6.25f, 0.5f, 31, 0},
                  {INT32_MIN, -6.25f, -0.03125f, 30.75f,
                   hbot::OverCurrent | hbot::OverTemperature}});
    all["feedback_watchdog"] = feedback(1300, hbot::WatchdogExpired | hbot::Fault, {});
    const float sevens = hbot::detail::floatOf(0x7F7F7F7Fu);
    all["feedback_largest"] =
        feedback(4294967295u, 0xFFFF,
                 std::vector<hbot::Reading>(16, {INT32_MIN, sevens, sevens, sevens, 0xFFFF}));
    return all;
}

} // namespace

TEST_CASE("vectors: every command of the page is decoded as the page says") {
    hbot::Decoder decoder;
    for (const auto &known : commands()) {
        CAPTURE(known.first);
        const Bytes &frame = page().vectors.at(known.first).at("frame");
        REQUIRE(heard(decoder, frame) == std::vector<hbot::Heard>{hbot::Heard::Command});
        const hbot::Command &command = decoder.command();
        CHECK(command.sequence == known.second.sequence);
        CHECK(command.enable == known.second.enable);
        CHECK(command.watchdogMs == 20);
        CHECK(std::vector<float>(command.torque, command.torque + command.joints) ==
              known.second.torque);
    }
    CHECK(heard(decoder, page().vectors.at("describe").at("frame")) ==
          std::vector<hbot::Heard>{hbot::Heard::Describe});
}

TEST_CASE("vectors: every answer of the page is encoded to its bytes") {
    for (const auto &answer : answers()) {
        CAPTURE(answer.first);
        CHECK(answer.second == page().vectors.at(answer.first).at("frame"));
    }
}

TEST_CASE("vectors: body and CRC of each vector make its frame, and no vector is unknown") {
    CHECK(page().vectors.size() == 9);
    for (const auto &vector : page().vectors) {
        CAPTURE(vector.first);
        const Bytes &body = vector.second.at("body");
        const uint32_t sum = hbot::detail::crc(body.data(), body.size());
        Bytes check;
        for (unsigned shift = 0; shift < 32; shift += 8) {
            check.push_back(static_cast<uint8_t>(sum >> shift));
        }
        CHECK(check == vector.second.at("crc"));
        CHECK(framed(body) == vector.second.at("frame"));
        const bool known = commands().count(vector.first) + answers().count(vector.first) == 1;
        CHECK((known || vector.first == "describe"));
    }
}

TEST_CASE("vectors: every frame to refuse is refused for the reason of the page") {
    const std::map<std::string, hbot::Heard> reasons = {{"Cobs", hbot::Heard::Cobs},
                                                        {"TooShort", hbot::Heard::TooShort},
                                                        {"Crc", hbot::Heard::Crc},
                                                        {"Body", hbot::Heard::Body}};
    std::set<std::string> seen;
    for (const Refusal &refusal : page().refusals) {
        // A controller decodes only what is for controllers.
        if (refusal.toController) {
            CAPTURE(refusal.error);
            hbot::Decoder decoder;
            CHECK(heard(decoder, refusal.bytes) ==
                  std::vector<hbot::Heard>{reasons.at(refusal.error)});
            seen.insert(refusal.error);
        }
    }
    CHECK(seen.size() == reasons.size());
}

TEST_CASE("vectors: the CRC is the one that the page names") {
    const char *nine = "123456789";
    CHECK(hbot::detail::crc(reinterpret_cast<const uint8_t *>(nine), 9) == 0xCBF43926u);
    CHECK(page().has("0xCBF43926"));
}

TEST_CASE("vectors: sizes, flags and limits are those of the page") {
    for (size_t joints : {1u, 2u, 4u, 8u, 16u}) {
        const std::string row = "| " + std::to_string(joints) + " | " +
                                std::to_string(hbot::commandFrameBytes(joints)) + " | " +
                                std::to_string(hbot::feedbackFrameBytes(joints)) + " | ";
        CHECK_MESSAGE(page().has(row), row);
    }
    const std::vector<std::pair<const char *, unsigned>> flags = {
        {"ENABLED", hbot::Enabled},       {"WATCHDOG_EXPIRED", hbot::WatchdogExpired},
        {"FAULT", hbot::Fault},           {"UNDESCRIBED", hbot::Undescribed},
        {"INDEX_SEEN", hbot::IndexSeen},  {"OVERCURRENT", hbot::OverCurrent},
        {"OVERTEMPERATURE", hbot::OverTemperature}};
    for (const auto &flag : flags) {
        const std::string row =
            "| `" + std::string(flag.first) + "` | 0x000" + std::to_string(flag.second) + " | ";
        CHECK_MESSAGE(page().has(row), row);
    }
    CHECK(page().has("| Protocol version | " + std::to_string(hbot::ProtocolVersion) + " |"));
    CHECK(page().has("| Joints of a port | " + std::to_string(hbot::MaxJoints) + " |"));
    CHECK(page().has("| Bytes of the firmware's name | " +
                   std::to_string(hbot::MaxFirmwareBytes) + " |"));
}

TEST_CASE("vectors: a run that ends with the frame has no code after it") {
    // The page: a frame grows by one byte for each 254 bytes begun. So a body whose bytes and CRC
    // are 254 bytes other than zero makes 256 bytes: one code, 254 bytes, the delimiter.
    for (uint8_t value = 1; value != 0; value++) {
        Bytes body(250, value);
        const uint32_t sum = hbot::detail::crc(body.data(), body.size());
        bool anyZero = false;
        for (unsigned shift = 0; shift < 32; shift += 8) {
            anyZero = anyZero || static_cast<uint8_t>(sum >> shift) == 0;
        }
        const Bytes frame = framed(body);
        if (!anyZero) {
            CHECK(frame.size() == 256);
            CHECK(frame[0] == 0xFF);
            CHECK(frame[255] == 0);
        }
    }
}

TEST_CASE("line: a body that is not exactly one message is refused") {
    const Bytes &command = page().vectors.at("command_enable").at("body");
    const auto with = [&command](size_t at, const Bytes &piece) {
        Bytes body(command.begin(), command.begin() + static_cast<std::ptrdiff_t>(at));
        body.insert(body.end(), piece.begin(), piece.end());
        return body;
    };
    // The bytes of this body: 01, sequence e8 07, enable 01, watchdog 14, four torques.
    REQUIRE(with(6, {}) == Bytes{0x01, 0xE8, 0x07, 0x01, 0x14, 0x04});
    Bytes left_over = command;
    left_over.push_back(0x55);
    Bytes seventeen = with(5, {17});
    seventeen.resize(seventeen.size() + 4 * 17, 0x3F);
    for (const Bytes &body :
         {left_over, with(command.size() - 1, {}), with(5, {}), with(3, {2, 0x14, 0}),
          with(4, {0x80, 0x80, 0x04, 0}), with(1, {0x80, 0x80, 0x80, 0x80, 0x10, 0, 1, 0}),
          seventeen, with(5, {0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x02})}) {
        hbot::Decoder decoder;
        CHECK(heard(decoder, framed(body)) == std::vector<hbot::Heard>{hbot::Heard::Body});
    }
    hbot::Decoder decoder;
    CHECK(heard(decoder, framed(command)) == std::vector<hbot::Heard>{hbot::Heard::Command});
    // A varint may have more bytes than it needs: hbot-link takes it too.
    CHECK(heard(decoder, framed(with(4, {0x94, 0x80, 0x00, 0x80, 0x00}))) ==
          std::vector<hbot::Heard>{hbot::Heard::Command});
    CHECK(decoder.command().watchdogMs == 20);
    CHECK(decoder.command().joints == 0);
}

TEST_CASE("line: a frame is decoded in pieces, after noise, and after a frame that is too long") {
    const Bytes &frame = page().vectors.at("command_enable").at("frame");
    hbot::Decoder decoder;
    // Half a frame, then the zero with which a host begins, then a whole frame.
    Bytes line(frame.begin(), frame.begin() + 9);
    line.push_back(0);
    line.insert(line.end(), frame.begin(), frame.end());
    CHECK(heard(decoder, line) ==
          std::vector<hbot::Heard>{hbot::Heard::Cobs, hbot::Heard::Command});
    // Empty frames mean nothing.
    CHECK(heard(decoder, Bytes(5, 0)).empty());
    // 80 bytes without a zero can still be the longest frame; one more cannot.
    CHECK(heard(decoder, Bytes(80, 1)).empty());
    CHECK(heard(decoder, Bytes(1000, 1)) == std::vector<hbot::Heard>{hbot::Heard::TooLong});
    CHECK(heard(decoder, Bytes(1, 0)).empty());
    CHECK(heard(decoder, frame) == std::vector<hbot::Heard>{hbot::Heard::Command});
    CHECK(heard(decoder, bytesOf(frame.data(), frame.size() - 1)).empty());
    CHECK(decoder.push(0) == hbot::Heard::Command);
}
