/* A spring that becomes stiffer step by step.
 *
 *     first_feel [ADDRESS [SECONDS]]       # default: 127.0.0.1:4268, 4 s
 *
 * Ends with 1 and the reason if something fails, also if the server dies meanwhile. */

#include <stdio.h>
#include <stdlib.h>

#include "hbot.h"

static const char *const SCENE =
    "name = \"A spring from C\"\n"
    "[[effect]]\n"
    "id = \"spring\"\n"
    "kind = \"spring\"\n"
    "anchor = \"here\"\n"
    "stiffness = 1.0\n"
    "damping = 0.02\n";

static hbot_status feel(hbot_client *rig, double seconds) {
    hbot_status status;
    if ((status = hbot_acquire(rig, false)) != HBOT_STATUS_OK) return status;
    if ((status = hbot_load_scene_toml(rig, SCENE)) != HBOT_STATUS_OK) return status;
    if ((status = hbot_enable(rig, NULL)) != HBOT_STATUS_OK) return status;
    if ((status = hbot_subscribe(rig, 100)) != HBOT_STATUS_OK) return status;

    hbot_state state;
    double start = -1.0, stiffness = 0.0;
    do {
        /* One state every 100 ticks. The wait is that long only if the server hangs. */
        if ((status = hbot_next_state(rig, 5000, &state)) != HBOT_STATUS_OK) return status;
        if (start < 0.0) start = state.t;
        const double wanted = 1.0 + (int)(4.0 * (state.t - start) / seconds);
        if (wanted != stiffness && wanted <= 4.0) {
            stiffness = wanted;
            status = hbot_set(rig, "spring", "stiffness", stiffness);
            if (status != HBOT_STATUS_OK) return status;
            printf("stiffness %.0f N m/rad, torque %.3f %.3f %.3f N m\n", stiffness, state.torque[0],
                   state.torque[1], state.torque[2]);
            fflush(stdout);
        }
    } while (state.t - start < seconds);

    if ((status = hbot_disable(rig, NULL)) != HBOT_STATUS_OK) return status;
    return hbot_release(rig);
}

int main(int argc, char **argv) {
    const char *const address = argc > 1 ? argv[1] : "127.0.0.1:4268";
    const double seconds = argc > 2 ? atof(argv[2]) : 4.0;
    const hbot_options options = {.name = "first_feel"};

    hbot_client *rig = NULL;
    hbot_status status = hbot_connect(address, &options, &rig);
    if (status == HBOT_STATUS_OK) status = feel(rig, seconds);
    if (status != HBOT_STATUS_OK) {
        fprintf(stderr, "%s: %s\n", hbot_status_name(status),
                status == HBOT_STATUS_NOTHING ? "no state for 5 s" : hbot_last_error());
    }
    hbot_close(rig);
    return status == HBOT_STATUS_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
