// Decodes inputs from the standard input, for tests/fuzz/arduino.rs to compare with hbot-link.
//
// An input is its length (4 bytes, least significant first, below 65536) and its bytes. The answer
// is a length and one record for each result of the decoder: its kind, and for a command its fields
// and the frame of a feedback that is made of them.
#include <HbotLink.h>
#include <stdio.h>
#include <vector>

namespace {

typedef std::vector<uint8_t> Bytes;

void put(Bytes &to, uint32_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; i++) {
        to.push_back(static_cast<uint8_t>(value >> (8 * i)));
    }
}

// Appends the fields of a command, and a feedback with as many joints.
void putCommand(Bytes &to, const hbot::Command &command) {
    put(to, command.sequence, 4);
    put(to, command.enable ? 1 : 0, 1);
    put(to, command.watchdogMs, 2);
    put(to, command.joints, 1);
    hbot::Reading readings[hbot::MaxJoints] = {};
    for (uint8_t j = 0; j < command.joints; j++) {
        const float torque = command.torque[j];
        const uint32_t bits = hbot::detail::bitsOf(torque);
        put(to, bits, 4);
        readings[j] = {static_cast<int32_t>(bits), torque, torque, torque,
                       static_cast<uint16_t>(bits & 0xFFFFu)};
    }
    uint8_t frame[hbot::feedbackFrameBytes(hbot::MaxJoints)];
    const size_t length = hbot::encodeFeedback(command.sequence, command.watchdogMs, readings,
                                               command.joints, frame);
    to.insert(to.end(), frame, frame + length);
}

bool readAll(uint8_t *to, size_t length) { return fread(to, 1, length, stdin) == length; }

} // namespace

int main() {
    uint8_t size[4];
    Bytes input, answer;
    while (readAll(size, sizeof size)) {
        input.resize(size[0] | static_cast<size_t>(size[1]) << 8);
        if (!readAll(input.data(), input.size())) {
            return 1;
        }
        hbot::Decoder decoder;
        answer.clear();
        for (uint8_t byte : input) {
            const hbot::Heard heard = decoder.push(byte);
            if (heard != hbot::Heard::Nothing) {
                answer.push_back(static_cast<uint8_t>(heard));
            }
            if (heard == hbot::Heard::Command) {
                putCommand(answer, decoder.command());
            }
        }
        Bytes length;
        put(length, static_cast<uint32_t>(answer.size()), 4);
        fwrite(length.data(), 1, length.size(), stdout);
        fwrite(answer.data(), 1, answer.size(), stdout);
    }
    return fflush(stdout) == 0 ? 0 : 1;
}
