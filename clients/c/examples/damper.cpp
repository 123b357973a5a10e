// A damper that this program renders itself: it computes a torque from every state.
//
//     damper [ADDRESS [SECONDS]]       # default: 127.0.0.1:4268, 5 s
//
// Ends with 1 and the reason if something fails, also if the server dies meanwhile.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "hbot.hpp"

int main(int argc, char** argv) try {
    const std::string address = argc > 1 ? argv[1] : "127.0.0.1:4268";
    const double seconds = argc > 2 ? std::atof(argv[2]) : 5.0;
    const double damping = 0.01;  // N m s/rad

    hbot::Options options;
    options.name = "damper";
    options.encoding = HBOT_ENCODING_MSGPACK;
    hbot::Client rig(address, options);
    const hbot::Lease lease(rig);  // given back at the end, also after an exception
    rig.load_scene_json(R"({"name": "Nothing", "effect": []})");
    rig.enable();
    std::printf("rendering on %s\n", rig.info().rig);
    std::fflush(stdout);

    hbot::Render render;
    render.duration = std::chrono::duration<double>(seconds);
    std::uint64_t oldest = 0;
    const auto report = rig.render(
        [&](const hbot_state& state) {
            if (state.has_client && state.client_age_ticks > oldest) oldest = state.client_age_ticks;
            return hbot::Vec3{-damping * state.omega[0], -damping * state.omega[1], -damping * state.omega[2]};
        },
        render);
    rig.disable();
    std::printf("%llu torques, %llu states missed, %llu torques refused, oldest torque %llu ticks, end %d\n",
                static_cast<unsigned long long>(report.rendered), static_cast<unsigned long long>(report.missed),
                static_cast<unsigned long long>(report.refused), static_cast<unsigned long long>(oldest),
                static_cast<int>(report.end));
    return report.end == HBOT_RENDER_END_DURATION ? EXIT_SUCCESS : EXIT_FAILURE;
} catch (const hbot::Error& error) {
    std::fprintf(stderr, "%s: %s\n", hbot_status_name(error.status()), error.what());
    return EXIT_FAILURE;
}
