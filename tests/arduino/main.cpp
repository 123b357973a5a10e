// The entry of the tests of clients/arduino/HbotLink. `build.sh` builds and runs them.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>
