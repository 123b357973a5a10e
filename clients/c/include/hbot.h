/* The client of an Hbot server for C. Written by cbindgen from clients/c/src: change it there.
 *
 * Functions return HBOT_STATUS_OK (0), or another status if they fail; hbot_last_error() then
 * has the reason as text. Only functions that cannot fail return something else.
 *
 * Pointers. A pointer to a result must point to a writable object of its type. A text is UTF-8
 * and ends with a zero byte. A pointer may be NULL only if the function says so; otherwise NULL
 * gives HBOT_STATUS_NULL_POINTER. A client is a pointer from hbot_connect() that has not been
 * given to hbot_close() yet. A function keeps no pointer after it has returned.
 *
 * Threads. Every function may be called from every thread. One client serves one call at a time:
 * a call during another call with the same client, also from a callback of hbot_render(), fails
 * with HBOT_STATUS_IN_USE at once and changes nothing. Use one client for each thread, and one
 * more for stops, so that a stop never waits. hbot_close() must be the last call with a client.
 *
 * Units are SI. Vectors are in frame N, and quaternions {w, x, y, z} turn sphere axes into
 * frame N. docs/axes.md explains other axes.
 */

#ifndef HBOT_H
#define HBOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Version of the structs and functions in this header. Compare it with hbot_abi_version().
#define HBOT_ABI_VERSION 1

// Largest number of half-spaces of a model.
#define HBOT_MAX_PLANES 8

// Largest number of joints of a rig: two for each of eight wheels.
#define HBOT_MAX_JOINTS 16

// What a function returns. 0: success. 1: nothing has arrived in the given time, which is no
// failure. 10 to 18: the server has refused the request. 30 to 37: the connection failed, or the
// answer did not come in time. 38: a number in the request is not finite, so nothing was sent.
// 50 to 54: the call was wrong. 55: a defect of this library.
typedef enum hbot_status {
  // Success.
  HBOT_STATUS_OK = 0,
  // Nothing has arrived in the given time. The connection is intact.
  HBOT_STATUS_NOTHING = 1,
  // The server could not read the request, or one of its fields is not legal.
  HBOT_STATUS_BAD_REQUEST = 10,
  // The server does not speak this client's version of the protocol.
  HBOT_STATUS_UNSUPPORTED_VERSION = 11,
  // The token is missing or wrong.
  HBOT_STATUS_UNAUTHORIZED = 12,
  // Only the holder of the lease may do this: call hbot_acquire() first.
  HBOT_STATUS_NOT_HOLDER = 13,
  // Another client has the lease. The text of the error names it.
  HBOT_STATUS_BUSY = 14,
  // The scene has no effect with this id.
  HBOT_STATUS_UNKNOWN_EFFECT = 15,
  // The value is legal in general, but not for this rig, this effect or this moment.
  HBOT_STATUS_OUT_OF_RANGE = 16,
  // The rig is in a fault or an emergency stop.
  HBOT_STATUS_FAULTED = 17,
  // The request is too long.
  HBOT_STATUS_TOO_LARGE = 18,
  // No program listens at the address.
  HBOT_STATUS_NO_SERVER = 30,
  // The text is no address, or its host is unknown.
  HBOT_STATUS_ADDRESS = 31,
  // Connecting failed for another reason.
  HBOT_STATUS_CONNECT = 32,
  // The server did not answer in time, or no state came. A connection that was open stays open.
  HBOT_STATUS_TIMEOUT = 33,
  // The server has closed the connection, or it has died. Connect again.
  HBOT_STATUS_CLOSED = 34,
  // Reading or writing failed. Connect again.
  HBOT_STATUS_IO = 35,
  // The server sent something that is no message of this protocol. Connect again.
  HBOT_STATUS_PROTOCOL = 36,
  // The encrypted connection failed, or only one side encrypts.
  HBOT_STATUS_TLS = 37,
  // A number in the request is not finite. Nothing was sent; the connection is intact.
  HBOT_STATUS_NOT_FINITE = 38,
  // A pointer is NULL that must not be.
  HBOT_STATUS_NULL_POINTER = 50,
  // A text is not UTF-8.
  HBOT_STATUS_NOT_UTF8 = 51,
  // An argument has an illegal value. The text of the error says which one.
  HBOT_STATUS_BAD_ARGUMENT = 52,
  // A scene file or text cannot be read. The text of the error names each mistake.
  HBOT_STATUS_BAD_SCENE = 53,
  // Another call with this client is running, in another thread or around this callback.
  HBOT_STATUS_IN_USE = 54,
  // A defect of this library. Close the client.
  HBOT_STATUS_PANIC = 55,
} hbot_status;

// What the rig is doing.
typedef enum hbot_mode {
  // The zeros of the steer joints are not known yet.
  HBOT_MODE_UNREFERENCED = 0,
  // Ready to be enabled, without torque.
  HBOT_MODE_IDLE = 1,
  // Enabled; the torque rises.
  HBOT_MODE_ENABLING = 2,
  // Renders the scene.
  HBOT_MODE_ACTIVE = 3,
  // Stopped by a fault, until a reset.
  HBOT_MODE_FAULT = 4,
  // Stopped by an emergency stop, until a reset.
  HBOT_MODE_ESTOP = 5,
} hbot_mode;

// The cause of a fault. docs/something-is-wrong.md explains them.
typedef enum hbot_fault {
  // There is no fault.
  HBOT_FAULT_NONE = 0,
  // No reading came from a motor controller in time.
  HBOT_FAULT_LINK_LOST = 1,
  // Too many damaged frames on the line.
  HBOT_FAULT_LINK_CORRUPT = 2,
  // A motor controller has reported a fault.
  HBOT_FAULT_CONTROLLER_FAULT = 3,
  // The sphere turned too fast.
  HBOT_FAULT_OVERSPEED = 4,
  // Too much current, or too much energy to the hand.
  HBOT_FAULT_OVERTORQUE = 5,
  // A wheel slipped too fast.
  HBOT_FAULT_SLIP = 6,
  // A computed value was not finite.
  HBOT_FAULT_NON_FINITE = 7,
  // A reading was physically impossible.
  HBOT_FAULT_IMPLAUSIBLE_FEEDBACK = 8,
  // The loop could not keep its rate.
  HBOT_FAULT_DEADLINE = 9,
  // The connection of the lease holder ended.
  HBOT_FAULT_CLIENT_LOST = 10,
  // A motor or its controller was too hot.
  HBOT_FAULT_THERMAL = 11,
} hbot_fault;

// What an hbot_event is about.
typedef enum hbot_event_kind {
  // An event of a later server. Ignore it.
  HBOT_EVENT_KIND_UNKNOWN = 0,
  // The rig went into a fault or an emergency stop, or left it: `tick`, `t`, `mode`, `fault`,
  // and in `text` the reason.
  HBOT_EVENT_KIND_FAULT = 1,
  // The lease has another holder: `cause`, `mine`, `session`, and in `text` the holder.
  HBOT_EVENT_KIND_LEASE = 2,
  // Another scene is rendered: `tick`, and in `text` its name.
  HBOT_EVENT_KIND_SCENE = 3,
  // States were dropped because this client read too slowly: `count`, `total`.
  HBOT_EVENT_KIND_DROPPED = 4,
  // Stream messages were refused: `count`, `total`, `status`, and in `text` the reason.
  HBOT_EVENT_KIND_REFUSED = 5,
  // The server ends: in `text` the reason.
  HBOT_EVENT_KIND_STOPPING = 6,
  // The sphere shakes by itself, or has its full torque again: `tick`, `t`, and in `text` what
  // was found.
  HBOT_EVENT_KIND_SHAKING = 7,
  // Parameters of an effect have changed: `tick`, and in `text` the id of the effect.
  HBOT_EVENT_KIND_SET = 8,
} hbot_event_kind;

// Why the lease has another holder.
typedef enum hbot_lease_cause {
  // The event is not about the lease.
  HBOT_LEASE_CAUSE_NONE = 0,
  // A client took the free lease.
  HBOT_LEASE_CAUSE_ACQUIRED = 1,
  // The holder gave it back.
  HBOT_LEASE_CAUSE_RELEASED = 2,
  // A client took it from the holder.
  HBOT_LEASE_CAUSE_STOLEN = 3,
  // The holder's connection ended.
  HBOT_LEASE_CAUSE_DISCONNECTED = 4,
} hbot_lease_cause;

// Why hbot_render() ended without an error.
typedef enum hbot_render_end {
  // The callback returned false.
  HBOT_RENDER_END_ASKED = 0,
  // The duration is over.
  HBOT_RENDER_END_DURATION = 1,
  // The rig is in a fault.
  HBOT_RENDER_END_FAULT = 2,
  // The rig is in an emergency stop.
  HBOT_RENDER_END_ESTOP = 3,
  // The rig was disabled.
  HBOT_RENDER_END_DISABLED = 4,
  // This client has lost the lease.
  HBOT_RENDER_END_LEASE_LOST = 5,
  // The server is stopping.
  HBOT_RENDER_END_SERVER_STOPPING = 6,
} hbot_render_end;

// The encoding of messages.
typedef enum hbot_encoding {
  // Lines of JSON.
  HBOT_ENCODING_JSON = 0,
  // MessagePack: shorter, and quicker to read.
  HBOT_ENCODING_MSGPACK = 1,
} hbot_encoding;

// Axes of other programs. docs/axes.md has the table.
typedef enum hbot_axes {
  // ROS: x forward, y left, z up.
  HBOT_AXES_ROS = 0,
  // Unity: x right, y up, z forward, left-handed.
  HBOT_AXES_UNITY = 1,
  // Unreal: x forward, y right, z up, left-handed.
  HBOT_AXES_UNREAL = 2,
  // CHAI3D: x towards the person, y right, z up.
  HBOT_AXES_CHAI3D = 3,
} hbot_axes;

// What hbot_render() does if several states have arrived, because the program was late.
typedef enum hbot_late {
  // Only the newest state is rendered; the others are counted as missed.
  HBOT_LATE_NEWEST = 0,
  // Every state is rendered, in order. The server refuses torques that are too old.
  HBOT_LATE_EACH = 1,
} hbot_late;

// A connection to a server.
//
// Opaque: a program only has a pointer to it.
typedef struct hbot_client hbot_client;

// Options of hbot_connect(). A field that is 0 or NULL has its default.
typedef struct hbot_options {
  // Name of the client, shown to people. Default: "c".
  const char *name;
  // The server's token. Default: none.
  const char *token;
  // PEM file with the server's certificate, or with that of its authority. With a file the
  // connection is encrypted; without one, connecting to a server that encrypts fails.
  const char *ca_file;
  // One of hbot_encoding. Default: JSON.
  uint32_t encoding;
  // Longest time for connecting, and later for each answer, ms. Default: 5000.
  uint32_t timeout_ms;
} hbot_options;

// One joint in one tick.
typedef struct hbot_joint {
  // Angle from the joint's zero, 0 to 2 pi rad.
  double angle;
  // Rate, rad/s.
  double rate;
  // Commanded torque at the joint, N m.
  double torque;
} hbot_joint;

// The state of the rig in one tick. docs/api.md explains the fields.
typedef struct hbot_state {
  // Number of the tick.
  uint64_t tick;
  // Time of the tick since the loop began, s.
  double t;
  // What the rig is doing.
  enum hbot_mode mode;
  // Cause of the fault, if the mode is fault.
  enum hbot_fault fault;
  // Orientation of the sphere: the unit quaternion {w, x, y, z} that turns sphere axes into
  // frame N.
  double q[4];
  // Angular velocity of the sphere in frame N, rad/s.
  double omega[3];
  // Torque on the sphere in frame N after all limits, N m.
  double torque[3];
  // Whether the scene pulls towards `reference`.
  bool has_reference;
  // Orientation to which the scene pulls, {w, x, y, z}; zeros without one.
  double reference[4];
  // Number of valid elements of `joints`.
  uint32_t joint_count;
  // Steer and drive of the first wheel, then of the next.
  struct hbot_joint joints[HBOT_MAX_JOINTS];
  // Largest slip that the encoders can show, m/s.
  double slip;
  // Fraction of the wanted torque that is left after all limits, 0 to 1.
  double scale;
  // Largest part of the friction limit that a contact uses, 0 to 1.
  double traction;
  // Energy given to the hand since the start, J.
  double energy;
  // Whether a stream message has been accepted, and `client_age_ticks` counts from it.
  bool has_client;
  // Whether that message had a number, `client_seq`.
  bool has_client_seq;
  // Number of the last accepted stream message.
  uint64_t client_seq;
  // Age of the last accepted stream message, ticks.
  uint64_t client_age_ticks;
  // From the deadline to the start of the tick, us.
  double lateness_us;
  // Computing time of the tick, us.
  double compute_us;
  // Time spent on the line, us.
  double link_us;
  // From the measurement of the joints until the torque computed from it was sent, us.
  double age_us;
  // By how much the scene was rendered ahead of its reading, us. 0 without a lead.
  double lead_us;
  // Whether a measurement with a sigma has been taken, and `orientation_sigma` is known.
  bool has_orientation_sigma;
  // Standard deviations of the error of `q` about the axes of frame N, rad.
  double orientation_sigma[3];
} hbot_state;

// An event other than a state. Fields that do not belong to its kind are 0.
typedef struct hbot_event {
  // What the event is about.
  enum hbot_event_kind kind;
  // Number of the tick in which it happened.
  uint64_t tick;
  // Time of that tick, s.
  double t;
  // Mode after a fault event.
  enum hbot_mode mode;
  // Cause of a fault event.
  enum hbot_fault fault;
  // Cause of a lease event.
  enum hbot_lease_cause cause;
  // Whether this client now has the lease.
  bool mine;
  // Session of the holder of the lease; 0 if it is free.
  uint64_t session;
  // Number of states or messages since the last event of this kind.
  uint64_t count;
  // Number of states or messages on this connection.
  uint64_t total;
  // Why the last stream message was refused.
  enum hbot_status status;
  // Text for people. A longer text is cut.
  char text[512];
  // Name of the client that asked for what a fault, lease, scene or set event reports, or of the
  // signal that stopped the rig. Empty if the rig stopped by itself.
  char by[72];
  // Session of that client; 0 if there is none.
  uint64_t by_session;
} hbot_event;

// The rig and its server. hbot_info_json() has the rest.
typedef struct hbot_info {
  // Name and version of the server program. A longer text is cut.
  char server[64];
  // Name of the rig. A longer text is cut.
  char rig[128];
  // Number of this connection.
  uint64_t session;
  // Whether the rig is simulated.
  bool simulated;
  // Ticks a second.
  uint32_t rate_hz;
  // Whether the server has told its clock, `clock_monotonic_ns` and `clock_unix_ns`.
  bool has_clock;
  // Time of tick 0 on CLOCK_MONOTONIC of the server's machine, ns.
  uint64_t clock_monotonic_ns;
  // The same moment on CLOCK_REALTIME, ns since 1970. A state with time `t` belongs to the
  // moment `clock_unix_ns + 1e9 t`.
  uint64_t clock_unix_ns;
  // Number of wheels. A state has two joints for each.
  uint32_t wheels;
  // Radius of the sphere, m.
  double sphere_radius;
  // Mass of the sphere, kg.
  double sphere_mass;
  // Largest torque on the sphere, N m.
  double max_torque;
  // Largest change of the torque, N m/s.
  double max_torque_rate;
  // Largest angular speed of the sphere with motors on, rad/s.
  double max_speed;
  // Largest age of a stream message, ticks.
  uint32_t max_age_ticks;
  // Stiffest spring that is stable with the damping `stable_damping`, N m/rad; 0 if unknown.
  double stable_stiffness;
  // Damping that belongs to `stable_stiffness`, N m s/rad.
  double stable_damping;
  // Whether the loop has told its largest torque in this posture, `capability`.
  bool has_capability;
  // Largest torque about n1, n2, n3 in this posture, N m.
  double capability[3];
} hbot_info;

// A half-space of turns that pushes the sphere back, such as a contact. It never pulls.
typedef struct hbot_plane {
  // Axis in frame N about which a turn leads into it.
  double normal[3];
  // Turn from the model's pose at which it begins, rad. Negative: the pose is inside.
  double offset;
  // Stiffness, N m/rad.
  double stiffness;
  // Damping inside, N m s/rad.
  double damping;
} hbot_plane;

// The torque near a pose: `torque` - `stiffness` * turn - `damping` * angular velocity - `planes`.
// All fields 0 is no torque.
typedef struct hbot_local_model {
  // Torque at the pose in frame N, N m.
  double torque[3];
  // Rows of the stiffness in frame N, N m/rad: symmetric, no eigenvalue below 0.
  double stiffness[3][3];
  // Rows of the damping in frame N, N m s/rad: symmetric, no eigenvalue below 0.
  double damping[3][3];
  // Whether `pose` counts. If not, the stiffness acts about the orientation of the state with
  // the number `tick` of the stream, or about the present one if that is 0.
  bool has_pose;
  // Orientation about which the stiffness acts, {w, x, y, z}.
  double pose[4];
  // Number of planes, at most HBOT_MAX_PLANES.
  uint32_t plane_count;
  // The planes.
  struct hbot_plane planes[HBOT_MAX_PLANES];
  // Time in which the torque of before blends into this one, ms, at most 200. 0: the time since
  // the last model, at most 50 ms.
  uint32_t blend_ms;
  // Whether the server may render a model that the loop does not keep stable with less
  // stiffness. If not, it refuses it.
  bool soften;
} hbot_local_model;

// What hbot_torque(), hbot_reference() and hbot_model() send with their values. Fields that are 0
// are left out.
typedef struct hbot_stream {
  // Time from the arrival at the server until the value expires, ms, 1 to 1000. 0: 20 ms.
  uint32_t valid_ms;
  // Tick of the state from which the value was computed. The server refuses one that is too old.
  uint64_t tick;
  // A number of your choice. States return the last accepted one as `client_seq`.
  uint64_t seq;
} hbot_stream;

// Options of hbot_render(). A field that is 0 has its default.
typedef struct hbot_render_options {
  // Number of ticks from one state to the next. Default: 1.
  uint64_t every;
  // Time until a torque expires, ms, 1 to 1000. Default: 20.
  uint32_t valid_ms;
  // One of hbot_late. Default: newest.
  uint32_t late;
  // Time after which the loop ends, s. Default (0): it does not end by itself.
  double duration;
} hbot_render_options;

// Computes a torque in frame N, N m, from a state. `torque` has three elements, which are zero
// before the call. `user` is the
// pointer that was given to hbot_render(). Returns false to end the loop; its torque is then not
// sent. It must not throw, and must not use the client that calls it.
typedef bool (*hbot_render_callback)(const struct hbot_state *state, double *torque, void *user);

// What hbot_render() has done.
typedef struct hbot_render_report {
  // Why the loop ended.
  enum hbot_render_end end;
  // Number of states from which a torque was computed and sent.
  uint64_t rendered;
  // Number of states that were passed over because a newer one had arrived.
  uint64_t missed;
  // Number of torques that the server refused, as far as it has reported them.
  uint64_t refused;
} hbot_render_report;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the HBOT_ABI_VERSION of the library. If it differs from that of the header with which
// a program was compiled, the program must not call any other function.
uint32_t hbot_abi_version(void);

// Converts a direction, a force or a velocity from frame N to `axes`, one of hbot_axes. `from` and
// `to` can be equal, as in all functions here.
enum hbot_status hbot_vector_to(uint32_t axes, const double from[3], double to[3]);

// Converts a direction, a force or a velocity from `axes` to frame N.
enum hbot_status hbot_vector_from(uint32_t axes, const double from[3], double to[3]);

// Converts a torque, an angular velocity or a rotation vector from frame N to `axes`.
enum hbot_status hbot_axial_to(uint32_t axes, const double from[3], double to[3]);

// Converts a torque, an angular velocity or a rotation vector from `axes` to frame N.
enum hbot_status hbot_axial_from(uint32_t axes, const double from[3], double to[3]);

// Converts an orientation {w, x, y, z} in frame N to `axes`: {w, x, y, z} for CHAI3D, {x, y, z, w}
// for the others.
enum hbot_status hbot_quaternion_to(uint32_t axes, const double from[4], double to[4]);

// Converts an orientation in `axes`, in the order of hbot_quaternion_to(), to {w, x, y, z} in
// frame N.
enum hbot_status hbot_quaternion_from(uint32_t axes, const double from[4], double to[4]);

// Connects to the server at `address`: HOST or HOST:PORT, as "127.0.0.1:4268". `options` can be
// NULL. On success `*client` is the new client, which hbot_close() ends.
enum hbot_status hbot_connect(const char *address,
                              const struct hbot_options *options,
                              struct hbot_client **client);

// Ends a connection and frees the client. The lease is given back, and a stream goes to zero. NULL
// is ignored. Fails with HBOT_STATUS_IN_USE, and closes nothing, during another call with it.
enum hbot_status hbot_close(struct hbot_client *client);

// Sets the longest time that a call waits for its answer, ms, at least 1.
enum hbot_status hbot_set_timeout(struct hbot_client *client, uint32_t timeout_ms);

// Reads the oldest state that has not been read yet, and waits for one for at most `timeout_ms`.
// Returns HBOT_STATUS_NOTHING if none has come. Needs hbot_subscribe().
enum hbot_status hbot_next_state(struct hbot_client *client,
                                 uint32_t timeout_ms,
                                 struct hbot_state *state);

// Reads the newest state that has arrived, and drops older ones; looks for newer ones for at most
// 20 ms. Waits for at most `timeout_ms` if none has arrived, and returns HBOT_STATUS_NOTHING if
// none comes. For programs that draw.
enum hbot_status hbot_latest_state(struct hbot_client *client,
                                   uint32_t timeout_ms,
                                   struct hbot_state *state);

// Reads the oldest event other than a state that has not been read yet, and waits for one for at
// most `timeout_ms`. Returns HBOT_STATUS_NOTHING if none has come. The last one of a server that
// ends is HBOT_EVENT_KIND_STOPPING.
enum hbot_status hbot_next_event(struct hbot_client *client,
                                 uint32_t timeout_ms,
                                 struct hbot_event *event);

// Writes to `*lost` how many states and events were dropped on this side because the program did
// not read them. The queue holds those of about four seconds.
enum hbot_status hbot_events_lost(struct hbot_client *client, uint64_t *lost);

// Asks for the description of the rig.
enum hbot_status hbot_info_get(struct hbot_client *client, struct hbot_info *info);

// Streams a local model. The server renders it in every tick until it expires or the next model
// comes. `stream` can be NULL. `scale` can be NULL: then the function does not wait for an answer,
// and if the server refuses the model, an event HBOT_EVENT_KIND_REFUSED comes. Otherwise it
// receives the fraction of the stiffness that is rendered.
enum hbot_status hbot_model(struct hbot_client *client,
                            const struct hbot_local_model *model,
                            const struct hbot_stream *stream,
                            double *scale);

// Takes the lease, which is the right to command. With `steal` also if another client has it;
// otherwise the status is then HBOT_STATUS_BUSY.
enum hbot_status hbot_acquire(struct hbot_client *client, bool steal);

// Gives the lease back, and ends the stream.
enum hbot_status hbot_release(struct hbot_client *client);

// Subscribes to one state every `every` ticks, 1 to 1000000. This replaces an earlier
// subscription.
enum hbot_status hbot_subscribe(struct hbot_client *client, uint64_t every);

// Ends the subscription.
enum hbot_status hbot_unsubscribe(struct hbot_client *client);

// Begins to render the scene; the torque rises within 0.5 s. `mode` can be NULL; it receives the
// mode from the next tick on.
enum hbot_status hbot_enable(struct hbot_client *client, enum hbot_mode *mode);

// Ends rendering; the torque falls within 50 ms. Needs no lease. `mode` as for hbot_enable().
enum hbot_status hbot_disable(struct hbot_client *client, enum hbot_mode *mode);

// Leaves a fault or an emergency stop after its cause is gone. `mode` as for hbot_enable().
enum hbot_status hbot_reset(struct hbot_client *client, enum hbot_mode *mode);

// Emergency stop: zero torque in the next tick. Needs no lease. `mode` as for hbot_enable().
enum hbot_status hbot_estop(struct hbot_client *client, enum hbot_mode *mode);

// Makes a simulated rig in virtual time run `ticks` ticks and then wait. `*state` receives the
// state of the last of them.
enum hbot_status hbot_advance(struct hbot_client *client, uint64_t ticks, struct hbot_state *state);

// Asks whether the server answers. `tick` and `t` receive the number and the time, s, of its last
// tick; both can be NULL.
enum hbot_status hbot_ping(struct hbot_client *client, uint64_t *tick, double *t);

// Writes to `*json` the server's statistics as JSON text (docs/api.md, `stats`). The text belongs
// to the client and is valid until the next call that returns a text, or until hbot_close().
enum hbot_status hbot_stats_json(struct hbot_client *client, const char **json);

// Writes to `*json` what the motor controllers report about themselves as JSON text (docs/api.md,
// `controllers`). The text lives as that of hbot_stats_json().
enum hbot_status hbot_controllers_json(struct hbot_client *client, const char **json);

// Writes to `*json` the answer to `info` as JSON text (docs/api.md), with the schemas of all
// effects and the running scene. The text lives as that of hbot_stats_json().
enum hbot_status hbot_info_json(struct hbot_client *client, const char **json);

// Sends a request as JSON text, such as {"op": "hand", "release": true}, for ops of docs/api.md
// that have no function here. It waits for the answer, also of a stream, and replaces the `id`.
// `*json` receives the body of the answer as JSON text, which lives as that of hbot_stats_json().
enum hbot_status hbot_request_json(struct hbot_client *client,
                                   const char *request,
                                   const char **json);

// Streams a torque in frame N, N m, without waiting for an answer. `stream` can be NULL. It is
// added to the scene's torque until it expires. If the server refuses it, an event
// HBOT_EVENT_KIND_REFUSED comes.
enum hbot_status hbot_torque(struct hbot_client *client,
                             const double torque[3],
                             const struct hbot_stream *stream);

// Streams a reference orientation {w, x, y, z} for an effect, without waiting for an answer.
// `omega`, its angular velocity in frame N, rad/s, can be NULL. `stream` can be NULL; its
// `valid_ms` is that of `omega`.
enum hbot_status hbot_reference(struct hbot_client *client,
                                const char *effect,
                                const double q[4],
                                const double omega[3],
                                const struct hbot_stream *stream);

// Corrects the server's orientation by one that was measured from outside, {w, x, y, z}. `weight`,
// 0 to 1, is the part of the difference that is corrected. `angle` can be NULL; it receives the
// difference before, rad.
enum hbot_status hbot_align(struct hbot_client *client,
                            const double q[4],
                            double weight,
                            double *angle);

// Subscribes to states, calls `callback` for each, and streams the torque that it computes, until
// something ends the loop. Needs the lease, and a rig that is enabled. `options` and `report` can
// be NULL. At the end the torque goes to zero and the subscription ends.
// Each torque carries the tick of its state. If yours comes from an older state, send it with
// hbot_torque() and that state's tick instead, or the age in states is too low.
//
// A callback that takes longer than `valid_ms` loses its torque until it returns. If no state
// comes within the client's timeout, the status is HBOT_STATUS_TIMEOUT.
enum hbot_status hbot_render(struct hbot_client *client,
                             const struct hbot_render_options *options,
                             hbot_render_callback callback,
                             void *user,
                             struct hbot_render_report *report);

// Loads a scene from a file (TOML, docs/files.md) on this machine, with the recordings that it
// names, and renders it. The file is checked here first; the text of the error names each mistake.
enum hbot_status hbot_load_scene_file(struct hbot_client *client, const char *path);

// Loads a scene from the text of a scene file (TOML). Like hbot_load_scene_file(), but without
// recordings.
enum hbot_status hbot_load_scene_toml(struct hbot_client *client, const char *toml);

// Loads a scene from JSON text of the shape that docs/api.md shows for `load_scene`. The server
// checks it.
enum hbot_status hbot_load_scene_json(struct hbot_client *client, const char *json);

// Changes one parameter of an effect that is a number, for example "stiffness". The change is
// blended in within 50 ms.
enum hbot_status hbot_set(struct hbot_client *client,
                          const char *effect,
                          const char *parameter,
                          double value);

// Changes parameters of an effect. `json` is a JSON object with their names and values, as
// {"stiffness": 2, "damping": 0.02}.
enum hbot_status hbot_set_json(struct hbot_client *client, const char *effect, const char *json);

// Returns the name of a mode, such as "idle", or "unknown" for a number that is none. The text is
// valid for ever.
const char *hbot_mode_name(int32_t mode);

// Returns the name of the cause of a fault, such as "link_lost", "none" for `HBOT_FAULT_NONE`, or
// "unknown" for a number that is none. The text is valid for ever.
const char *hbot_fault_name(int32_t fault);

// Returns the reason of the last failed call of this thread, as text for people. Returns an empty
// text if none has failed. The text is valid until the next failing call of this thread.
const char *hbot_last_error(void);

// Returns the name of a status, such as "not_holder", or "unknown" for a number that is none. The
// text is valid for ever.
const char *hbot_status_name(int32_t status);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HBOT_H */
