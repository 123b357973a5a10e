// What the tests of the C client share.

#ifndef CHECK_HPP
#define CHECK_HPP

#include <chrono>
#include <cstdio>
#include <cstdlib>

// Ends the program with the failed condition and its place.
#define CHECK(condition)                                                                       \
    do {                                                                                       \
        if (!(condition)) {                                                                    \
            std::fprintf(stderr, "%s:%d: not true: %s\nlast error: %s\n", __FILE__, __LINE__, #condition, \
                         hbot_last_error());                                                   \
            std::exit(1);                                                                      \
        }                                                                                      \
    } while (false)

// Calls `condition` until it is true. Fails after a minute, which no machine needs.
template <typename Condition>
bool eventually(Condition&& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (std::chrono::steady_clock::now() < end) {
        if (condition()) return true;
    }
    return false;
}

#endif
