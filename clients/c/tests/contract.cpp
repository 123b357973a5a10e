// The contract of hbot.h and hbot.hpp against a running server, whose address is the argument.

#include <cmath>
#include <cstring>
#include <string>
#include <thread>

#include "check.hpp"
#include "hbot.hpp"

namespace {

std::string address;

const char* const SPRING =
    "name = \"Test\"\n[[effect]]\nid = \"spring\"\nkind = \"spring\"\nanchor = \"here\"\nstiffness = 1.0\n";

// Returns the status that `call` throws.
template <typename Call>
hbot_status thrown(Call&& call) {
    try {
        call();
    } catch (const hbot::Error& error) {
        CHECK(std::strlen(error.what()) > 0);
        return error.status();
    }
    return HBOT_STATUS_OK;
}

hbot::Client connected(const char* name, hbot_encoding encoding = HBOT_ENCODING_JSON) {
    hbot::Options options;
    options.name = name;
    options.encoding = encoding;
    return hbot::Client(address, options);
}

void wrong_arguments_are_refused() {
    hbot_client* client = nullptr;
    hbot_state state;
    CHECK(hbot_connect(nullptr, nullptr, &client) == HBOT_STATUS_NULL_POINTER);
    CHECK(hbot_connect(address.c_str(), nullptr, nullptr) == HBOT_STATUS_NULL_POINTER);
    CHECK(hbot_connect("\xff", nullptr, &client) == HBOT_STATUS_NOT_UTF8);
    CHECK(hbot_connect("127.0.0.1:seven", nullptr, &client) == HBOT_STATUS_ADDRESS);
    CHECK(hbot_connect("127.0.0.1:1", nullptr, &client) == HBOT_STATUS_NO_SERVER);
    hbot_options options{};
    options.encoding = 7;
    CHECK(hbot_connect(address.c_str(), &options, &client) == HBOT_STATUS_BAD_ARGUMENT);
    CHECK(std::string(hbot_last_error()) == "encoding is 7; legal: 0 and 1");
    options.encoding = 0;
    options.ca_file = "/nowhere.pem";
    CHECK(hbot_connect(address.c_str(), &options, &client) == HBOT_STATUS_TLS);
    CHECK(client == nullptr);
    CHECK(hbot_enable(nullptr, nullptr) == HBOT_STATUS_NULL_POINTER);
    CHECK(hbot_close(nullptr) == HBOT_STATUS_OK);

    CHECK(hbot_connect(address.c_str(), nullptr, &client) == HBOT_STATUS_OK);
    CHECK(hbot_next_state(client, 0, nullptr) == HBOT_STATUS_NULL_POINTER);
    CHECK(hbot_next_state(client, 0, &state) == HBOT_STATUS_NOTHING);
    CHECK(hbot_set_timeout(client, 0) == HBOT_STATUS_BAD_ARGUMENT);
    CHECK(hbot_torque(client, nullptr, nullptr) == HBOT_STATUS_NULL_POINTER);
    CHECK(hbot_render(client, nullptr, nullptr, nullptr, nullptr) == HBOT_STATUS_NULL_POINTER);
    const double nan[3] = {0.0, std::nan(""), 0.0};
    CHECK(hbot_torque(client, nan, nullptr) == HBOT_STATUS_NOT_FINITE);
    CHECK(hbot_set(client, "spring", "stiffness", std::nan("")) == HBOT_STATUS_NOT_FINITE);
    hbot_local_model model{};
    CHECK(hbot_model(client, nullptr, nullptr, nullptr) == HBOT_STATUS_NULL_POINTER);
    model.plane_count = HBOT_MAX_PLANES + 1;
    CHECK(hbot_model(client, &model, nullptr, nullptr) == HBOT_STATUS_BAD_ARGUMENT);
    model.plane_count = 0;
    model.stiffness[1][2] = std::nan("");
    CHECK(hbot_model(client, &model, nullptr, nullptr) == HBOT_STATUS_NOT_FINITE);
    CHECK(hbot_load_scene_toml(client, "effect = 3\n") == HBOT_STATUS_BAD_SCENE);
    CHECK(hbot_load_scene_file(client, "nowhere.toml") == HBOT_STATUS_BAD_SCENE);
    CHECK(std::strstr(hbot_last_error(), "nowhere.toml") != nullptr);
    CHECK(hbot_set_json(client, "spring", "[1]") == HBOT_STATUS_BAD_ARGUMENT);
    CHECK(hbot_close(client) == HBOT_STATUS_OK);
    CHECK(std::string(hbot_status_name(HBOT_STATUS_BUSY)) == "busy");
    CHECK(std::string(hbot_status_name(-5)) == "unknown");
    CHECK(std::string(hbot_mode_name(HBOT_MODE_ESTOP)) == "estop");
    CHECK(std::string(hbot_mode_name(HBOT_MODE_ESTOP + 1)) == "unknown");
    CHECK(std::string(hbot_fault_name(HBOT_FAULT_NONE)) == "none");
    CHECK(std::string(hbot_fault_name(HBOT_FAULT_THERMAL)) == "thermal");
    CHECK(std::string(hbot_fault_name(HBOT_FAULT_THERMAL + 1)) == "unknown");
}

void the_server_refuses(hbot::Client& rig) {
    CHECK(thrown([&] { rig.enable(); }) == HBOT_STATUS_NOT_HOLDER);
    hbot::Client other = connected("other");
    other.acquire();
    CHECK(thrown([&] { rig.acquire(); }) == HBOT_STATUS_BUSY);
    CHECK(std::strstr(hbot_last_error(), "other") != nullptr);
    other.load_scene_toml(SPRING);
    CHECK(thrown([&] { other.set("nothing", "stiffness", 1.0); }) == HBOT_STATUS_UNKNOWN_EFFECT);
    CHECK(thrown([&] { other.set("spring", "stiffness", -1.0); }) == HBOT_STATUS_OUT_OF_RANGE);
    CHECK(thrown([&] { other.subscribe(0); }) == HBOT_STATUS_BAD_REQUEST);
    const hbot::Lease stolen(rig, true);
    CHECK(eventually([&] {
        const auto event = other.next_event(hbot::Milliseconds{100});
        return event && event->kind == HBOT_EVENT_KIND_LEASE && event->cause == HBOT_LEASE_CAUSE_STOLEN &&
               !event->mine && std::string(event->text) == "contract";
    }));
}

void the_rig_is_described(hbot::Client& rig) {
    const hbot_info info = rig.info();
    CHECK(std::string(info.rig) == "Hbot prototype" && info.simulated && info.rate_hz == 1000);
    CHECK(info.wheels == 2 && info.sphere_radius > 0.05 && info.max_torque > 0.1 && info.session > 0);
    CHECK(info.stable_stiffness > 0.1);
    // Tick 0 was before now on this machine's clock, and the rig started less than a day ago.
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const double age = std::chrono::duration<double>(now).count() - 1e-9 * static_cast<double>(info.clock_unix_ns);
    CHECK(info.has_clock && info.clock_monotonic_ns > 0 && age > 0.0 && age < 86400.0);
    CHECK(rig.info_json().find("\"on_client_lost\"") != std::string::npos);
    CHECK(rig.stats_json().find("\"late_ticks\"") != std::string::npos);
    CHECK(rig.controllers_json().find("\"temperature_c\":25.0") != std::string::npos);
    CHECK(rig.request_json("{\"op\": \"ping\", \"data\": [7]}").find("\"data\":[7]") != std::string::npos);
    CHECK(thrown([&] { rig.request_json("{\"op\": \"subscribe\", \"evry\": 1}"); }) == HBOT_STATUS_BAD_REQUEST);
    const std::uint64_t tick = rig.ping();
    CHECK(eventually([&] { return rig.ping() > tick; }));
}

void scenes_and_references(hbot::Client& rig) {
    const hbot::Lease lease(rig);
    rig.load_scene_file("scenes/spring.toml");
    rig.load_scene_json("{\"name\": \"From JSON\", \"effect\": []}");
    rig.load_scene_toml("name = \"Test\"\n[[effect]]\nid = \"spring\"\nkind = \"spring\"\nstiffness = 1.0\n");
    CHECK(eventually([&] {
        const auto event = rig.next_event(hbot::Milliseconds{100});
        return event && event->kind == HBOT_EVENT_KIND_SCENE && std::string(event->text) == "Test";
    }));
    rig.set("spring", "stiffness", 2.0);
    rig.set_json("spring", "{\"stiffness\": 3, \"damping\": 0.01}");
    CHECK(rig.info_json().find("\"stiffness\":3") != std::string::npos);
    CHECK(rig.align({1.0, 0.0, 0.0, 0.0}, 0.0) >= 0.0);
    // References of clients act only while the rig renders.
    rig.enable();
    rig.subscribe(1);
    // A turn of 0.2 rad about n3.
    const hbot::Quat wanted{std::cos(0.1), 0.0, 0.0, std::sin(0.1)};
    hbot_stream stream{};
    stream.seq = 77;
    rig.reference("spring", wanted, {}, stream);
    hbot_state state{};
    CHECK(eventually([&] {
        const auto newest = rig.latest_state(hbot::Milliseconds{100});
        if (newest) state = *newest;
        return state.has_client_seq && state.client_seq == 77 && state.has_reference &&
               std::fabs(state.reference[3] - wanted[3]) < 1e-6;
    }));
    CHECK(state.joint_count == 4 && state.mode != HBOT_MODE_UNREFERENCED && state.fault == HBOT_FAULT_NONE);
    const auto oldest = rig.next_state(hbot::Milliseconds{5000});
    CHECK(oldest && oldest->tick > state.tick);

    hbot_local_model model{};
    for (int axis = 0; axis < 3; ++axis) model.stiffness[axis][axis] = 0.5, model.damping[axis][axis] = 0.02;
    model.planes[0] = {{0.0, 0.0, 1.0}, 0.1, 1.0, 0.02};
    model.plane_count = 1;
    stream.seq = 78;
    CHECK(rig.try_model(model, stream) == 1.0);
    model.stiffness[0][0] = 1e5;
    model.soften = true;
    stream.seq = 79;
    const double scale = rig.try_model(model, stream);
    CHECK(scale > 0.0 && scale < 0.01);
    model.soften = false;
    CHECK(hbot_model(rig.get(), &model, &stream, &state.scale) == HBOT_STATUS_OUT_OF_RANGE);
    model.stiffness[0][0] = 0.5;
    stream.seq = 80;
    rig.model(model, stream);
    CHECK(eventually([&] {
        const auto newest = rig.latest_state(hbot::Milliseconds{100});
        return newest && newest->has_client_seq && newest->client_seq == 80;
    }));
    rig.unsubscribe();
}

void rendering(hbot::Client& rig) {
    hbot::Lease lease(rig);
    rig.load_scene_json("{\"name\": \"Nothing\", \"effect\": []}");
    rig.enable();
    std::uint64_t calls = 0;
    auto report = rig.render([&](const hbot_state&) -> std::optional<hbot::Vec3> {
        // The client is in use by the loop.
        CHECK(hbot_ping(rig.get(), nullptr, nullptr) == HBOT_STATUS_IN_USE);
        CHECK(hbot_close(rig.get()) == HBOT_STATUS_IN_USE);
        if (++calls == 20) return std::nullopt;
        return hbot::Vec3{0.0, 0.0, 0.0};
    });
    CHECK(report.end == HBOT_RENDER_END_ASKED && report.rendered == 19);

    struct Odd {};
    bool caught = false;
    try {
        rig.render([](const hbot_state&) -> hbot::Vec3 { throw Odd(); });
    } catch (const Odd&) {
        caught = true;
    }
    CHECK(caught);

    hbot::Render options;
    options.duration = std::chrono::duration<double>(-1.0);
    const auto zero = [](const hbot_state&) { return hbot::Vec3{}; };
    CHECK(thrown([&] { rig.render(zero, options); }) == HBOT_STATUS_BAD_ARGUMENT);
    options.duration = std::chrono::duration<double>(0.05);
    CHECK(rig.render(zero, options).end == HBOT_RENDER_END_DURATION);

    // Another client stops the rig from another thread, as soon as the loop runs.
    hbot::Client stop = connected("stop");
    std::thread thread;
    report = rig.render([&](const hbot_state&) {
        if (!thread.joinable()) thread = std::thread([&] { CHECK(stop.estop() == HBOT_MODE_ESTOP); });
        return hbot::Vec3{};
    });
    thread.join();
    CHECK(report.end == HBOT_RENDER_END_ESTOP);
    CHECK(thrown([&] { rig.enable(); }) == HBOT_STATUS_FAULTED);
    CHECK(eventually([&] {
        const auto event = rig.next_event(hbot::Milliseconds{100});
        return event && event->kind == HBOT_EVENT_KIND_FAULT && event->mode == HBOT_MODE_ESTOP &&
               std::strstr(event->text, "stop") != nullptr;
    }));
    CHECK(rig.reset() == HBOT_MODE_IDLE);
    rig.enable();

    // Another client takes the lease.
    thread = std::thread();
    report = rig.render([&](const hbot_state&) {
        if (!thread.joinable()) thread = std::thread([&] { stop.acquire(true); });
        return hbot::Vec3{};
    });
    thread.join();
    CHECK(report.end == HBOT_RENDER_END_LEASE_LOST);
    CHECK(thrown([&] { rig.render(zero); }) == HBOT_STATUS_NOT_HOLDER);
    stop.disable();
    stop.release();
    rig.acquire();  // The Lease gives it back.
}

void one_call_at_a_time(hbot::Client& rig) {
    // The first call waits for an event that does not come; the other thread finds the client in use.
    hbot_event event;
    while (hbot_next_event(rig.get(), 0, &event) == HBOT_STATUS_OK) {
    }
    bool in_use = false;
    while (!in_use) {
        std::thread waiting([&] {
            hbot_event none;
            hbot_next_event(rig.get(), 50, &none);
        });
        for (int k = 0; k < 1000 && !in_use; ++k) in_use = hbot_ping(rig.get(), nullptr, nullptr) == HBOT_STATUS_IN_USE;
        waiting.join();
    }
    CHECK(rig.ping() > 0);
}

void axes() {
    const hbot::Vec3 n{1.0, 2.0, 3.0};
    CHECK((hbot::vector_to(HBOT_AXES_UNITY, n) == hbot::Vec3{1.0, 3.0, 2.0}));
    CHECK((hbot::axial_to(HBOT_AXES_UNREAL, n) == hbot::Vec3{-2.0, -1.0, -3.0}));
    CHECK((hbot::vector_to(HBOT_AXES_CHAI3D, n) == hbot::Vec3{-2.0, 1.0, 3.0}));
    for (const hbot_axes axes : {HBOT_AXES_ROS, HBOT_AXES_UNITY, HBOT_AXES_UNREAL, HBOT_AXES_CHAI3D}) {
        const hbot::Quat q{0.5, -0.5, 0.1, 0.7};
        CHECK(hbot::vector_from(axes, hbot::vector_to(axes, n)) == n);
        CHECK(hbot::axial_from(axes, hbot::axial_to(axes, n)) == n);
        CHECK(hbot::quaternion_from(axes, hbot::quaternion_to(axes, q)) == q);
    }
    double in_place[3] = {1.0, 2.0, 3.0};
    CHECK(hbot_vector_to(HBOT_AXES_ROS, in_place, in_place) == HBOT_STATUS_OK);
    CHECK(in_place[0] == 2.0 && in_place[1] == -1.0 && in_place[2] == 3.0);
    CHECK(hbot_vector_to(9, in_place, in_place) == HBOT_STATUS_BAD_ARGUMENT);
}

}  // namespace

int main(int, char** argv) {
    address = argv[1];
    CHECK(hbot_abi_version() == HBOT_ABI_VERSION);
    axes();
    wrong_arguments_are_refused();
    for (const hbot_encoding encoding : {HBOT_ENCODING_JSON, HBOT_ENCODING_MSGPACK}) {
        hbot::Client rig = connected("contract", encoding);
        the_rig_is_described(rig);
        the_server_refuses(rig);
        scenes_and_references(rig);
        rendering(rig);
        one_call_at_a_time(rig);
    }
    std::puts("contract: all true");
}
