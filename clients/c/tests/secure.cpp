// An encrypted connection with a token. Arguments: the address, the certificate's file, the token.

#include "check.hpp"
#include "hbot.hpp"

int main(int, char** argv) {
    const auto status = [&](const char* ca_file, const char* token) {
        const hbot_options options{"secure", token, ca_file, HBOT_ENCODING_MSGPACK, 5000};
        hbot_client* client = nullptr;
        const hbot_status status = hbot_connect(argv[1], &options, &client);
        CHECK((status == HBOT_STATUS_OK) == (client != nullptr));
        if (client) CHECK(hbot_ping(client, nullptr, nullptr) == HBOT_STATUS_OK);
        CHECK(hbot_close(client) == HBOT_STATUS_OK);
        return status;
    };
    CHECK(status(argv[2], argv[3]) == HBOT_STATUS_OK);
    CHECK(status(argv[2], "another token, which is wrong") == HBOT_STATUS_UNAUTHORIZED);
    CHECK(status(argv[2], nullptr) == HBOT_STATUS_UNAUTHORIZED);
    CHECK(status(nullptr, argv[3]) == HBOT_STATUS_TLS);
    std::puts("secure: all true");
}
