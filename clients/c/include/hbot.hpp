// The client of an Hbot server for C++17: hbot.h with RAII and exceptions. Header only; link with
// the same library as C.
//
// A failed call throws hbot::Error, which has the status and the text. No exception passes through
// the C library: what a callback of Client::render() throws is kept and thrown again afterwards.
//
// Threads: as in hbot.h. One Client serves one call at a time; a second call at the same time fails
// with HBOT_STATUS_IN_USE. Use one Client for each thread.

#ifndef HBOT_HPP
#define HBOT_HPP

#include <array>
#include <chrono>
#include <cstdint>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "hbot.h"

namespace hbot {

using Vec3 = std::array<double, 3>;
using Quat = std::array<double, 4>;
using Milliseconds = std::chrono::duration<std::uint32_t, std::milli>;

// A failed call.
class Error : public std::runtime_error {
public:
    Error(hbot_status status, const std::string& text) : std::runtime_error(text), status_(status) {}

    // Why the call failed.
    hbot_status status() const noexcept { return status_; }

private:
    hbot_status status_;
};

// Throws an Error unless `status` is HBOT_STATUS_OK. Returns false for HBOT_STATUS_NOTHING.
inline bool check(hbot_status status) {
    if (status == HBOT_STATUS_OK) return true;
    if (status == HBOT_STATUS_NOTHING) return false;
    throw Error(status, hbot_last_error());
}

// Options of a connection. An empty text is one that is not given.
struct Options {
    std::string name = "c++";
    std::string token;
    // PEM file with the certificate of the server, or of its authority. Switches encryption on.
    std::string ca_file;
    hbot_encoding encoding = HBOT_ENCODING_JSON;
    Milliseconds timeout{5000};
};

// Options of Client::render(); see hbot_render_options.
struct Render {
    std::uint64_t every = 1;
    Milliseconds valid{20};
    hbot_late late = HBOT_LATE_NEWEST;
    // Time after which the loop ends. Without a value, or with 0, it does not end by itself.
    std::optional<std::chrono::duration<double>> duration;
};

// A connection to a server. Closes it at the end of its life.
class Client {
public:
    explicit Client(const std::string& address = "127.0.0.1:4268", const Options& options = {}) {
        if (hbot_abi_version() != HBOT_ABI_VERSION) {
            throw Error(HBOT_STATUS_UNSUPPORTED_VERSION, "hbot.h and the library are of different versions");
        }
        const auto text = [](const std::string& s) { return s.empty() ? nullptr : s.c_str(); };
        const hbot_options given{text(options.name), text(options.token), text(options.ca_file),
                                 static_cast<std::uint32_t>(options.encoding), options.timeout.count()};
        check(hbot_connect(address.c_str(), &given, &client_));
    }

    ~Client() { hbot_close(client_); }
    Client(Client&& other) noexcept : client_(std::exchange(other.client_, nullptr)) {}
    Client& operator=(Client&& other) noexcept {
        std::swap(client_, other.client_);
        return *this;
    }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    // The pointer for functions of hbot.h. It stays the property of this object.
    hbot_client* get() const noexcept { return client_; }

    hbot_info info() { return read<hbot_info>(hbot_info_get); }
    std::string info_json() { return text(hbot_info_json); }
    std::string stats_json() { return text(hbot_stats_json); }
    std::string controllers_json() { return text(hbot_controllers_json); }
    std::string request_json(const std::string& request) {
        const char* json = nullptr;
        check(hbot_request_json(client_, request.c_str(), &json));
        return json;
    }
    void set_timeout(Milliseconds timeout) { check(hbot_set_timeout(client_, timeout.count())); }
    // The number of the server's last tick.
    std::uint64_t ping() {
        std::uint64_t tick = 0;
        check(hbot_ping(client_, &tick, nullptr));
        return tick;
    }

    // The state after `ticks` ticks of virtual time.
    hbot_state advance(std::uint64_t ticks) {
        hbot_state state{};
        check(hbot_advance(client_, ticks, &state));
        return state;
    }

    void acquire(bool steal = false) { check(hbot_acquire(client_, steal)); }
    void release() { check(hbot_release(client_)); }
    hbot_mode enable() { return read<hbot_mode>(hbot_enable); }
    hbot_mode disable() { return read<hbot_mode>(hbot_disable); }
    hbot_mode reset() { return read<hbot_mode>(hbot_reset); }
    hbot_mode estop() { return read<hbot_mode>(hbot_estop); }

    void load_scene_file(const std::string& path) { check(hbot_load_scene_file(client_, path.c_str())); }
    void load_scene_toml(const std::string& toml) { check(hbot_load_scene_toml(client_, toml.c_str())); }
    void load_scene_json(const std::string& json) { check(hbot_load_scene_json(client_, json.c_str())); }
    void set(const std::string& effect, const std::string& parameter, double value) {
        check(hbot_set(client_, effect.c_str(), parameter.c_str(), value));
    }
    void set_json(const std::string& effect, const std::string& json) {
        check(hbot_set_json(client_, effect.c_str(), json.c_str()));
    }

    // The streams; see hbot_torque() and hbot_reference().
    void torque(const Vec3& torque, const hbot_stream& stream = {}) {
        check(hbot_torque(client_, torque.data(), &stream));
    }
    void model(const hbot_local_model& model, const hbot_stream& stream = {}) {
        check(hbot_model(client_, &model, &stream, nullptr));
    }
    // Waits for the answer: the fraction of the stiffness that is rendered.
    double try_model(const hbot_local_model& model, const hbot_stream& stream = {}) {
        double scale = 0.0;
        check(hbot_model(client_, &model, &stream, &scale));
        return scale;
    }
    void reference(const std::string& effect, const Quat& q, const std::optional<Vec3>& omega = {},
                   const hbot_stream& stream = {}) {
        check(hbot_reference(client_, effect.c_str(), q.data(), omega ? omega->data() : nullptr, &stream));
    }
    // Corrects the server's orientation. Returns the difference before, rad.
    double align(const Quat& q, double weight) {
        double angle = 0.0;
        check(hbot_align(client_, q.data(), weight, &angle));
        return angle;
    }

    void subscribe(std::uint64_t every = 1) { check(hbot_subscribe(client_, every)); }
    void unsubscribe() { check(hbot_unsubscribe(client_)); }
    // The oldest state that was not read yet; without a value if none comes in time.
    std::optional<hbot_state> next_state(Milliseconds timeout) {
        return poll<hbot_state>(hbot_next_state, timeout);
    }
    // The newest state that has arrived; older ones are dropped.
    std::optional<hbot_state> latest_state(Milliseconds timeout = Milliseconds{0}) {
        return poll<hbot_state>(hbot_latest_state, timeout);
    }
    // The oldest event other than a state that was not read yet.
    std::optional<hbot_event> next_event(Milliseconds timeout = Milliseconds{0}) {
        return poll<hbot_event>(hbot_next_event, timeout);
    }
    std::uint64_t events_lost() { return read<std::uint64_t>(hbot_events_lost); }

    // Calls `compute` for each state and streams the torque that it returns, a std::optional<Vec3>
    // or a Vec3; without a value the loop ends. If it throws, the loop ends and throws the same.
    template <typename Compute>
    hbot_render_report render(Compute&& compute, const Render& options = {}) {
        struct Call {
            std::remove_reference_t<Compute>* compute;
            std::exception_ptr thrown;
        } call{&compute, nullptr};
        const auto callback = [](const hbot_state* state, double* torque, void* user) -> bool {
            auto& call = *static_cast<Call*>(user);
            try {
                const std::optional<Vec3> computed = (*call.compute)(*state);
                if (!computed) return false;
                for (std::size_t k = 0; k < 3; ++k) torque[k] = (*computed)[k];
                return true;
            } catch (...) {
                call.thrown = std::current_exception();
                return false;
            }
        };
        const hbot_render_options given{options.every, options.valid.count(),
                                        static_cast<std::uint32_t>(options.late),
                                        options.duration ? options.duration->count() : 0.0};
        hbot_render_report report{};
        const hbot_status status = hbot_render(client_, &given, callback, &call, &report);
        if (call.thrown) std::rethrow_exception(call.thrown);
        check(status);
        return report;
    }

private:
    template <typename T>
    T read(hbot_status (*function)(hbot_client*, T*)) {
        T value{};
        check(function(client_, &value));
        return value;
    }

    template <typename T>
    std::optional<T> poll(hbot_status (*function)(hbot_client*, std::uint32_t, T*), Milliseconds timeout) {
        T value{};
        if (!check(function(client_, timeout.count(), &value))) return std::nullopt;
        return value;
    }

    std::string text(hbot_status (*function)(hbot_client*, const char**)) {
        const char* text = nullptr;
        check(function(client_, &text));
        return text;
    }

    hbot_client* client_ = nullptr;
};

// The lease, from its construction to the end of its life. A Lease can be neither copied nor moved.
// It refers to the Client object that it was made with, which must live longer and must not be moved
// away: the lease would then be free only when the connection ends.
class Lease {
public:
    explicit Lease(Client& client, bool steal = false) : client_(&client) { client.acquire(steal); }
    // Without an exception: if the connection is broken, the lease is free in any case.
    ~Lease() { hbot_release(client_->get()); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;

private:
    Client* client_;
};

// Vectors and quaternions for other programs; docs/axes.md has the table.
namespace detail {
template <typename T>
T converted(hbot_status (*function)(std::uint32_t, const double*, double*), hbot_axes axes, const T& from) {
    T to{};
    check(function(static_cast<std::uint32_t>(axes), from.data(), to.data()));
    return to;
}
}  // namespace detail

inline Vec3 vector_to(hbot_axes axes, const Vec3& v) { return detail::converted(hbot_vector_to, axes, v); }
inline Vec3 vector_from(hbot_axes axes, const Vec3& v) { return detail::converted(hbot_vector_from, axes, v); }
inline Vec3 axial_to(hbot_axes axes, const Vec3& v) { return detail::converted(hbot_axial_to, axes, v); }
inline Vec3 axial_from(hbot_axes axes, const Vec3& v) { return detail::converted(hbot_axial_from, axes, v); }
inline Quat quaternion_to(hbot_axes axes, const Quat& q) {
    return detail::converted(hbot_quaternion_to, axes, q);
}
inline Quat quaternion_from(hbot_axes axes, const Quat& q) {
    return detail::converted(hbot_quaternion_from, axes, q);
}

}  // namespace hbot

#endif
