/* One tick of the balanced controller in plain C, for comparing its speed with the Rust version.
 *
 * The formulas are those of docs/internals/physics.md. The steps are those of the bench `tick/f64/balanced/2` in
 * benches/tick.rs: two wheels of the prototype, midpoint odometry, a geodesic spring and a damper.
 *
 * Things that the bench never does are left out: commands other than enable, streams, corrections
 * from outside, moving references, and rows of G that are close to losing rank. If a joint torque
 * exceeds its limit, all torques are scaled down together. This does not happen in the bench either,
 * and the program prints how often it happened.
 *
 *   tick [ticks] [repetitions] [ticks a repetition]
 *
 * The program runs `ticks` ticks first and prints the last torque and a checksum. Then it prints the
 * minimum, median and maximum time per tick in ns over the repetitions. -DMAX_WHEELS=2 makes all
 * arrays just large enough for the prototype.
 *
 * -DWATCH=1 adds the watch on encoder counts (crates/hbot-core/src/safety/watch.rs), which the Rust version
 * has for safety. It changes no result.
 */
#define _GNU_SOURCE
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifndef MAX_WHEELS
#define MAX_WHEELS 8
#endif
#ifndef WATCH
#define WATCH 0
#endif
#define MAX_JOINTS (2 * MAX_WHEELS)
#define MAX_EFFECTS 32
#define HISTORY 1024
#define DEPTH 64
#define FRACTION_BITS 24
#define PI 3.14159265358979323846
#define TURN (2.0 * PI)
#define MAX_RATE 1.0e4
#define WHOLE 0.01
#define BLEND_S 0.05
#define SOFT_START_S 0.5
/* Constants of the watch: the duration of a block; the factor on the speed limit above which a motion
 * is impossible; how far counts and rates may disagree, as a fraction and in rad/s; counts lost to
 * rounding; the longest interval in ticks that is still checked; the margin on the limits. */
#define BLOCK_S 0.025
#define IMPOSSIBLE 4.0
#define DISAGREEMENT 0.5
#define DISAGREEMENT_RATE 0.1
#define GRAIN 2.0
#define COARSE 5
#define MARGIN 1.05

/* Vectors, quaternions, matrices. */

typedef struct { double x, y, z; } vec3;
typedef struct { double w, x, y, z; } quat;
typedef struct { vec3 c0, c1, c2; } mat3;

static inline vec3 vec(double x, double y, double z) { return (vec3){x, y, z}; }
static inline vec3 add(vec3 a, vec3 b) { return vec(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline vec3 sub(vec3 a, vec3 b) { return vec(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline vec3 mul(vec3 a, double k) { return vec(a.x * k, a.y * k, a.z * k); }
static inline double dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec3 cross(vec3 a, vec3 b)
{
    return vec(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline bool finite3(vec3 a) { return isfinite(a.x) && isfinite(a.y) && isfinite(a.z); }
static inline bool nonzero(vec3 a) { return a.x != 0.0 || a.y != 0.0 || a.z != 0.0; }
static inline double largest(vec3 a) { return fmax(fabs(a.x), fmax(fabs(a.y), fabs(a.z))); }

static inline vec3 apply(const mat3 *m, vec3 v)
{
    return add(add(mul(m->c0, v.x), mul(m->c1, v.y)), mul(m->c2, v.z));
}

static inline quat product(quat a, quat b)
{
    return (quat){a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                  a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
static inline quat conjugate(quat q) { return (quat){q.w, -q.x, -q.y, -q.z}; }
static inline quat scaled(quat q, double k) { return (quat){q.w * k, q.x * k, q.y * k, q.z * k}; }
static inline bool same(quat a, quat b) { return a.w == b.w && a.x == b.x && a.y == b.y && a.z == b.z; }
/* Normalizes q by one Newton step for 1/sqrt. q must have unit norm except for rounding. */
static inline quat renormalized(quat q)
{
    return scaled(q, 1.5 - 0.5 * (q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z));
}
static inline vec3 rotate(quat q, vec3 v)
{
    vec3 e = vec(q.x, q.y, q.z);
    vec3 t = mul(cross(e, v), 2.0);
    return add(v, add(mul(t, q.w), cross(e, t)));
}

static inline quat exponential(vec3 v)
{
    double t2 = dot(v, v);
    if (t2 < 1.0 / 1024.0) {
        double eta = 1.0 - t2 * (1.0 / 8.0) * (1.0 - t2 * (1.0 / 48.0) * (1.0 - t2 * (1.0 / 120.0)));
        double k = 0.5 - t2 * (1.0 / 48.0) * (1.0 - t2 * (1.0 / 80.0) * (1.0 - t2 * (1.0 / 168.0)));
        return (quat){eta, v.x * k, v.y * k, v.z * k};
    }
    double t = sqrt(t2), s, c;
    sincos(0.5 * t, &s, &c);
    double k = s / t;
    return (quat){c, v.x * k, v.y * k, v.z * k};
}

/* Returns t / sin(t/2), where t is the angle of the unit quaternion (eta, e) with eta >= 0. */
static inline double angle_over_sine(double eta, vec3 e)
{
    double s2 = dot(e, e);
    if (s2 < 8.0e-4 * eta * eta) {
        double x2 = s2 / (eta * eta);
        return 2.0 * (1.0 - x2 * (1.0 / 3.0 - x2 * (0.2 - x2 * (1.0 / 7.0 - x2 * (1.0 / 9.0))))) / eta;
    }
    double s = sqrt(s2);
    return 2.0 * atan2(s, eta) / s;
}

/* Symmetric 3x3 matrices. */

typedef struct { double xx, yy, zz, xy, xz, yz; } sym3;

static inline void add_outer(sym3 *m, vec3 g, double k)
{
    vec3 h = mul(g, k);
    m->xx += g.x * h.x;
    m->yy += g.y * h.y;
    m->zz += g.z * h.z;
    m->xy += g.x * h.y;
    m->xz += g.x * h.z;
    m->yz += g.y * h.z;
}
static inline sym3 adjugate(const sym3 *m)
{
    return (sym3){m->yy * m->zz - m->yz * m->yz, m->xx * m->zz - m->xz * m->xz, m->xx * m->yy - m->xy * m->xy,
                  m->xz * m->yz - m->xy * m->zz, m->xy * m->yz - m->xz * m->yy, m->xy * m->xz - m->xx * m->yz};
}
static inline double determinant(const sym3 *m, const sym3 *a)
{
    return m->xx * a->xx + m->xy * a->xy + m->xz * a->xz;
}
static inline vec3 times(const sym3 *m, vec3 v)
{
    return vec(m->xx * v.x + m->xy * v.y + m->xz * v.z, m->xy * v.x + m->yy * v.y + m->yz * v.z,
               m->xz * v.x + m->yz * v.y + m->zz * v.z);
}
/* Returns whether the smallest eigenvalue of m is larger than `ratio` times the largest one, and not
 * only because of rounding. a is the adjugate of m, det its determinant. */
static inline bool rank_above(const sym3 *m, const sym3 *a, double det, double ratio)
{
    double pairs = a->xx + a->yy + a->zz, sum = m->xx + m->yy + m->zz;
    double flat = fmax(ratio / 9.0, 8.0 * 2.220446049250313e-16 / ratio);
    return det > ratio * pairs * sum && pairs > flat * sum * sum;
}

/* The device. */

typedef struct {
    vec3 p[3], q[3], s[3]; /* contact frame: p cos th + q sin th + s, column by column */
    double axis_c1, axis_c2, radius;
    double arm_steer, arm_cross;
} wheel;

typedef struct {
    double radius;
    int wheels;
    wheel wheel[MAX_WHEELS];
} device;

typedef struct { vec3 c1, c2, c3; } frame;

typedef struct {
    int32_t last;
    bool reversed;
    int64_t position, turn;
    double radians_per_unit, radians_per_count;
} encoder;

static wheel make_wheel(vec3 axis, double cone, double toe, double radius, double sphere_radius)
{
    vec3 l = mul(axis, 1.0 / sqrt(dot(axis, axis)));
    double k = 1.0 / (1.0 + l.z);
    vec3 a0 = vec(1.0 - l.x * l.x * k, -l.x * l.y * k, -l.x), a1 = vec(-l.x * l.y * k, 1.0 - l.y * l.y * k, -l.y);
    double sa = sin(cone), ca = cos(cone), sb = sin(toe), cb = cos(toe);
    vec3 columns[3] = {vec(cb, ca * sb, sa * sb), vec(-sb, ca * cb, sa * cb), vec(0.0, -sa, ca)};
    wheel w = {.axis_c1 = sa * sb, .axis_c2 = sa * cb, .radius = radius};
    for (int i = 0; i < 3; i++) {
        w.p[i] = add(mul(a0, columns[i].x), mul(a1, columns[i].y));
        w.q[i] = add(mul(a0, -columns[i].y), mul(a1, columns[i].x));
        w.s[i] = mul(l, columns[i].z);
    }
    w.arm_steer = sphere_radius * w.axis_c2;
    w.arm_cross = sphere_radius * w.axis_c1;
    return w;
}

static encoder make_encoder(uint32_t counts_per_turn, double gear, bool reversed)
{
    double counts = counts_per_turn * gear;
    encoder e = {.reversed = reversed};
    e.turn = (int64_t)round(counts * (double)(1LL << FRACTION_BITS));
    e.radians_per_unit = TURN / (double)e.turn;
    e.radians_per_count = reversed ? -TURN / counts : TURN / counts;
    return e;
}

static inline int64_t within(int64_t x, int64_t turn)
{
    x %= turn;
    return x < 0 ? x + turn : x;
}
static inline int32_t moved(const encoder *e, int32_t count) { return (int32_t)((uint32_t)count - (uint32_t)e->last); }
static inline double signed_by(const encoder *e, double x) { return e->reversed ? -x : x; }
static inline void take(encoder *e, int32_t count)
{
    int64_t delta = (int64_t)moved(e, count) * (1LL << FRACTION_BITS);
    e->last = count;
    e->position += e->reversed ? -delta : delta;
    if (e->position < 0 || e->position >= e->turn)
        e->position = within(e->position, e->turn);
}

static inline frame frame_at(const wheel *w, double th)
{
    double s, c;
    sincos(th, &s, &c);
    return (frame){add(add(mul(w->p[0], c), mul(w->q[0], s)), w->s[0]),
                   add(add(mul(w->p[1], c), mul(w->q[1], s)), w->s[1]),
                   add(add(mul(w->p[2], c), mul(w->q[2], s)), w->s[2])};
}

/* Computes H zd of one wheel: the velocity of its contact due to its joints, along c2 (u) and c1 (v). */
static inline void wheel_velocity(const device *d, const wheel *w, const double *zd, double *u, double *v)
{
    *u = d->radius * w->axis_c2 * zd[0];
    *v = w->radius * zd[1] - d->radius * w->axis_c1 * zd[0];
}

/* Returns the angular velocity of the sphere, w = -(Z'Z)^-1 Z' H zd. */
static inline vec3 forward(const device *d, const frame *frames, const double *zd)
{
    vec3 b = {0};
    sym3 m = {0};
    for (int i = 0; i < d->wheels; i++) {
        double u, v;
        wheel_velocity(d, &d->wheel[i], zd + 2 * i, &u, &v);
        const frame *f = &frames[i];
        b = add(b, sub(mul(f->c2, u), mul(f->c1, v)));
        vec3 n = f->c3;
        m.xx += n.y * n.y + n.z * n.z;
        m.yy += n.x * n.x + n.z * n.z;
        m.zz += n.x * n.x + n.y * n.y;
        m.xy -= n.x * n.y;
        m.xz -= n.x * n.z;
        m.yz -= n.y * n.z;
    }
    sym3 a = adjugate(&m);
    return mul(times(&a, b), 1.0 / (determinant(&m, &a) * d->radius));
}

/* The controller. */

enum mode { UNREFERENCED, IDLE, ENABLING, ACTIVE, FAULT };
enum cause {
    NONE, LINK_LOST, LINK_CORRUPT, CONTROLLER_FAULT, OVERSPEED, OVERTORQUE, SLIP, NON_FINITE, IMPLAUSIBLE, DEADLINE, THERMAL
};
enum kind { SPRING, DAMPER };

typedef struct {
    uint32_t sequence;
    int32_t counts[MAX_JOINTS];
    double rates[MAX_JOINTS];
    uint16_t index_seen;
    bool fault, watchdog, overcurrent, overtemperature;
} feedback;

typedef struct {
    uint64_t tick, lateness_ns;
    bool has_feedback, rebooted, enable;
    uint16_t corrupt_frames;
    feedback feedback;
} inputs;

typedef struct {
    bool enable;
    double torque[MAX_JOINTS];
} drive;

typedef struct {
    uint64_t tick;
    enum mode mode;
    enum cause cause;
    quat q;
    vec3 omega, torque;
    int joints;
    double angle[MAX_JOINTS], rate[MAX_JOINTS], joint_torque[MAX_JOINTS];
    double slip, scale, traction, energy;
    bool deficient, fresh;
} state;

typedef struct {
    drive drive;
    state state;
} outputs;

typedef struct {
    enum kind kind;
    double gain, fade_s;
    mat3 matrix;
    quat reference;
} effect;

typedef struct {
    uint64_t revision;
    int effects;
    effect effect[MAX_EFFECTS];
} scene;

typedef struct {
    double age_s;
    quat q, goal;
    vec3 omega, branch;
    uint64_t omega_until;
} memory;

/* The motion of the joints in a block: net change and length of the path, by encoder counts (rad) and
 * by rates (rad/s; half a period makes it an angle). */
typedef struct {
    double counted[MAX_JOINTS], counted_length[MAX_JOINTS], rated[MAX_JOINTS], rated_length[MAX_JOINTS];
} motions;

typedef struct {
    uint32_t block, ticks, late, last_late, reading_late, last_ticks;
    double most[MAX_JOINTS], grain[MAX_JOINTS], grain_slip;
    bool coarse, has_last;
    motions now, last;
    double last_rate[MAX_JOINTS];
    double rolled[MAX_JOINTS]; /* twice the angle of each joint without slip */
    vec3 turn, last_turn;
    enum cause verdict;
} watch;

typedef struct {
    device device;
    double period_s, timeout_ticks;
    double torque_limit, torque_rate, speed_limit, slip_limit, grip, reference_rate, align_rate;
    double peak[MAX_JOINTS], weight[MAX_JOINTS];

    encoder encoders[MAX_JOINTS];
    bool has_sequence;
    uint32_t sequence;
    frame frames[MAX_WHEELS];
    vec3 rows[MAX_JOINTS];
    double angle[MAX_JOINTS], rate[MAX_JOINTS];
    vec3 omega;
    double slip;

    quat q, integral, correction;
    vec3 pending;
    struct { uint64_t tick; quat q; } history[HISTORY];

    enum mode mode;
    enum cause cause, present;
    double gain;
    bool has_tick, referenced, has_revision;
    uint64_t last_tick, revision, since_feedback;
    double corrupt;

    memory memories[MAX_EFFECTS];
    vec3 offset, blended;
    double blend_left;
    vec3 stream_torque;
    double stream_level;
    vec3 torque;

    double energy;
    vec3 sent[DEPTH];
    uint32_t newest;

    watch watch;
} controller;

static inline bool powered(const controller *c) { return c->gain > 0.0 || c->mode == ENABLING || c->mode == ACTIVE; }

static void observe(controller *c, enum cause cause)
{
    c->present = cause;
    if (cause == NONE)
        return;
    if (c->mode != FAULT) {
        c->mode = FAULT;
        c->cause = cause;
    }
    c->gain = 0.0;
}

static inline vec3 limited(vec3 v, double limit)
{
    double n2 = dot(v, v);
    if (!(n2 > limit * limit))
        return v;
    return mul(v, limit / sqrt(n2));
}

static inline enum cause rates(controller *c, const feedback *f)
{
    int n = 2 * c->device.wheels;
    for (int i = 0; i < n; i++) {
        double reported = f->rates[i];
        if (!isfinite(reported))
            return NON_FINITE;
        if (fabs(reported) > MAX_RATE)
            return IMPLAUSIBLE;
        c->rate[i] = signed_by(&c->encoders[i], reported);
    }
    return NONE;
}

/* Computes the joint angles, the posture with the rows of G, the sphere's angular velocity, and the
 * slip. */
static inline void locate(controller *c)
{
    const device *d = &c->device;
    for (int i = 0; i < 2 * d->wheels; i++)
        c->angle[i] = (double)c->encoders[i].position * c->encoders[i].radians_per_unit;
    for (int i = 0; i < d->wheels; i++) {
        const wheel *w = &d->wheel[i];
        frame f = frame_at(w, c->angle[2 * i]);
        vec3 steer = mul(f.c2, 1.0 / w->axis_c2);
        c->frames[i] = f;
        c->rows[2 * i] = steer;
        c->rows[2 * i + 1] = mul(sub(mul(steer, w->axis_c1), f.c1), d->radius / w->radius);
    }
    c->omega = forward(d, c->frames, c->rate);
    double most = 0.0;
    for (int i = 0; i < d->wheels; i++) {
        double u, v;
        wheel_velocity(d, &d->wheel[i], c->rate + 2 * i, &u, &v);
        u -= d->radius * dot(c->frames[i].c2, c->omega);
        v += d->radius * dot(c->frames[i].c1, c->omega);
        most = fmax(most, u * u + v * v);
    }
    c->slip = sqrt(most);
}

/* Records the torque of command `sequence`. Skipped commands count as a repetition of the last one. */
static inline void sent(controller *c, uint32_t sequence, vec3 torque)
{
    int32_t ahead = (int32_t)(sequence - c->newest);
    if (ahead > 1) {
        vec3 held = c->sent[c->newest % DEPTH];
        for (uint32_t k = 1; k < (uint32_t)ahead && k < DEPTH; k++)
            c->sent[(c->newest + k) % DEPTH] = held;
    }
    c->newest = sequence;
    c->sent[sequence % DEPTH] = torque;
}

static inline void turned(controller *c, uint32_t from, uint32_t to, vec3 turn)
{
    uint32_t steps = to - from < 1 ? 1 : to - from > DEPTH ? DEPTH : to - from;
    vec3 sum = {0};
    for (uint32_t k = 0; k < steps; k++)
        sum = add(sum, c->sent[(from + k) % DEPTH]);
    c->energy += dot(sum, turn) / steps;
}

/* The watch: sums of encoder counts over blocks of 25 ms, which are compared with the limits of speed
 * and slip, and over two blocks with the rates. */

static void begin_block(watch *w)
{
    w->ticks = w->late = 0;
    w->coarse = false;
    memset(&w->now, 0, sizeof w->now);
    memset(w->rolled, 0, sizeof w->rolled);
    w->turn = w->last_turn = vec(0.0, 0.0, 0.0);
}

static void restart_watch(controller *c)
{
    watch *w = &c->watch;
    begin_block(w);
    memcpy(w->last_rate, c->rate, sizeof w->last_rate);
    w->has_last = false;
    w->last_late = 0;
    w->verdict = NONE;
}

/* The largest angle that a joint can have turned in `ticks` ticks, at most half a turn. */
static inline double most(const watch *w, int joint, uint32_t ticks)
{
    return fmin(w->most[joint] * ticks + w->grain[joint], PI);
}

/* Adds the motion without slip at the present posture, for half of the last turn and of the next. */
static inline void begin_interval(controller *c, vec3 turn)
{
    watch *w = &c->watch;
    vec3 turns = add(w->last_turn, turn);
    for (int i = 0; i < 2 * c->device.wheels; i++)
        w->rolled[i] += dot(c->rows[i], turns);
}

static enum cause judge(const controller *c)
{
    const watch *w = &c->watch;
    const device *d = &c->device;
    uint32_t late = w->late > w->last_late ? w->late : w->last_late;
    double time = (w->ticks + late) * c->period_s;
    if (sqrt(dot(w->turn, w->turn)) > MARGIN * c->speed_limit * time)
        return OVERSPEED;
    if (w->coarse)
        return NONE;
    double slip = 0.0;
    for (int i = 0; i < d->wheels; i++) {
        double slid[2], u, v;
        for (int k = 0; k < 2; k++)
            slid[k] = w->now.counted[2 * i + k] - 0.5 * w->rolled[2 * i + k];
        wheel_velocity(d, &d->wheel[i], slid, &u, &v);
        slip = fmax(slip, u * u + v * v);
    }
    if (sqrt(slip) > MARGIN * c->slip_limit * time + w->grain_slip)
        return SLIP;
    if (!w->has_last)
        return NONE;
    uint32_t ticks = w->ticks + w->last_ticks;
    double share = DISAGREEMENT + (double)late / ticks, half = 0.5 * c->period_s;
    const motions *now = &w->now, *last = &w->last;
    for (int i = 0; i < 2 * d->wheels; i++) {
        double counted = now->counted[i] + last->counted[i], rated = (now->rated[i] + last->rated[i]) * half;
        double length = fmax(now->counted_length[i] + last->counted_length[i],
                             (now->rated_length[i] + last->rated_length[i]) * half);
        if (fabs(counted - rated) > share * length + DISAGREEMENT_RATE * ticks * c->period_s + w->grain[i])
            return IMPLAUSIBLE;
    }
    return NONE;
}

static __attribute__((noinline)) void end_block(controller *c)
{
    watch *w = &c->watch;
    begin_interval(c, vec(0.0, 0.0, 0.0));
    w->verdict = judge(c);
    w->has_last = !w->coarse;
    w->last = w->now;
    w->last_ticks = w->ticks;
    w->last_late = w->late;
    begin_block(w);
}

static inline void end_interval(controller *c, const double *delta, vec3 turn, uint32_t ticks, uint32_t late)
{
    watch *w = &c->watch;
    for (int i = 0; i < 2 * c->device.wheels; i++) {
        double rated = (w->last_rate[i] + c->rate[i]) * ticks;
        w->last_rate[i] = c->rate[i];
        w->now.counted[i] += delta[i];
        w->now.counted_length[i] += fabs(delta[i]);
        w->now.rated[i] += rated;
        w->now.rated_length[i] += fabs(rated);
    }
    w->turn = add(w->turn, turn);
    w->last_turn = turn;
    w->ticks += ticks;
    if (late > w->late)
        w->late = late;
    if (w->reading_late > w->late)
        w->late = w->reading_late;
    w->reading_late = late;
    w->coarse |= ticks > COARSE || w->late > COARSE;
    if (w->ticks >= w->block)
        end_block(c);
}

static inline enum cause measure(controller *c, const inputs *in, uint64_t elapsed, bool *fresh)
{
    const feedback *f = &in->feedback;
    const device *d = &c->device;
    int n = 2 * d->wheels;
    if (in->rebooted)
        c->referenced = false;
    *fresh = in->has_feedback && (!c->has_sequence || (int32_t)(f->sequence - c->sequence) > 0);
    if (!*fresh) {
        c->since_feedback += elapsed;
        return NONE;
    }
    c->since_feedback = 0;
    if (!c->referenced) {
        for (int i = 0; i < n; i++) {
            int64_t count = c->encoders[i].reversed ? -(int64_t)f->counts[i] : f->counts[i];
            c->encoders[i].last = f->counts[i];
            c->encoders[i].position = within(count * (1LL << FRACTION_BITS), c->encoders[i].turn);
        }
        c->has_sequence = true;
        c->sequence = f->sequence;
        enum cause cause = rates(c, f);
        if (cause == NONE)
            locate(c);
        if (WATCH)
            restart_watch(c);
        return cause;
    }

    uint32_t last = c->sequence, ticks = f->sequence - last;
    uint32_t behind = (uint32_t)in->tick - f->sequence, late = behind > elapsed ? behind - (uint32_t)elapsed : 0;
    bool judged = WATCH && (powered(c) || c->cause != NONE);
    double delta[MAX_JOINTS];
    bool plausible = true;
    for (int i = 0; i < n; i++) {
        delta[i] = moved(&c->encoders[i], f->counts[i]) * c->encoders[i].radians_per_count;
        plausible &= fabs(delta[i]) < (judged ? most(&c->watch, i, ticks + late) : PI);
    }
    enum cause cause = rates(c, f);
    if (cause != NONE)
        return cause;
    for (int i = 0; i < n; i++)
        take(&c->encoders[i], f->counts[i]);
    c->sequence = f->sequence;
    vec3 turn = {0};
    if (plausible) {
        frame frames[MAX_WHEELS];
        for (int i = 0; i < d->wheels; i++)
            frames[i] = frame_at(&d->wheel[i], c->angle[2 * i] + 0.5 * delta[2 * i]);
        turn = forward(d, frames, delta);
    }
    if (judged)
        begin_interval(c, turn);
    locate(c);
    if (judged && plausible)
        end_interval(c, delta, turn, ticks, late);
    else if (WATCH)
        restart_watch(c);
    if (!plausible)
        return IMPLAUSIBLE;
    c->integral = renormalized(product(exponential(turn), c->integral));
    turned(c, last, f->sequence, turn);
    return NONE;
}

static inline void settle(controller *c, uint64_t tick, double step)
{
    c->history[tick % HISTORY].tick = tick;
    c->history[tick % HISTORY].q = c->integral;
    if (nonzero(c->pending)) {
        vec3 turn = limited(c->pending, step);
        c->pending = sub(c->pending, turn);
        c->correction = renormalized(product(exponential(turn), c->correction));
    }
    c->q = same(c->correction, (quat){1.0, 0.0, 0.0, 0.0}) ? c->integral
                                                           : renormalized(product(c->correction, c->integral));
}

static inline enum cause fault(controller *c, const inputs *in, uint64_t elapsed, enum cause measured)
{
    c->corrupt = fmin(fmax(c->corrupt - (double)elapsed / 20.0, 0.0) + in->corrupt_frames, 20.0);
    const feedback *f = &in->feedback;
    bool heard = in->has_feedback, power = powered(c);
    if (in->rebooted || (heard && f->fault))
        return CONTROLLER_FAULT;
    if (heard && f->overcurrent)
        return OVERTORQUE;
    if (heard && f->overtemperature)
        return THERMAL;
    if (measured != NONE)
        return measured;
    if ((double)c->since_feedback > c->timeout_ticks || (heard && f->watchdog && power))
        return LINK_LOST;
    if (c->corrupt >= 10.0)
        return LINK_CORRUPT;
    if (in->lateness_ns > 20000000 || elapsed > 10)
        return DEADLINE;
    enum cause by_counts = WATCH && power ? c->watch.verdict : NONE;
    if (by_counts == OVERSPEED || (power && dot(c->omega, c->omega) > c->speed_limit * c->speed_limit))
        return OVERSPEED;
    if (by_counts == SLIP || (power && c->slip > c->slip_limit))
        return SLIP;
    if (by_counts != NONE)
        return by_counts;
    if (!c->referenced && c->mode == UNREFERENCED && heard) {
        c->referenced = true;
        c->mode = IDLE;
    }
    return NONE;
}

/* Returns the torque of the geodesic spring: T = -R_d M' K p, p = log(q_d^-1 q),
 * M' = I + [p]/2 + k [p]^2. */
static inline vec3 geodesic(quat desired, quat q, const mat3 *stiffness, vec3 *branch)
{
    quat x = product(conjugate(desired), q);
    if (x.w < 0.0)
        x = scaled(x, -1.0);
    vec3 e = vec(x.x, x.y, x.z);
    if (x.w == 0.0 && dot(e, *branch) < 0.0)
        e = mul(e, -1.0);
    double factor = angle_over_sine(x.w, e);
    vec3 p = mul(e, factor), kp = apply(stiffness, p);
    double t2 = dot(p, p), k;
    if (t2 < 0.09)
        k = 1.0 / 12.0 +
            t2 * (1.0 / 720.0 + t2 * (1.0 / 30240.0 + t2 * (1.0 / 1209600.0 + t2 * (1.0 / 47900160.0))));
    else
        k = (1.0 - 0.5 * factor * x.w) / t2;
    *branch = p;
    vec3 pk = cross(p, kp);
    vec3 torque = add(add(kp, mul(pk, 0.5)), mul(cross(p, pk), k));
    return rotate(desired, mul(torque, -1.0));
}

static inline void approach(quat *q, quat goal, double reach)
{
    quat x = product(goal, conjugate(*q));
    if (x.w < 0.0)
        x = scaled(x, -1.0);
    vec3 e = vec(x.x, x.y, x.z), way = mul(e, angle_over_sine(x.w, e));
    *q = dot(way, way) > reach * reach ? renormalized(product(exponential(limited(way, reach)), *q)) : goal;
}

static inline vec3 render(controller *c, const scene *scene, uint64_t tick, double dt)
{
    vec3 torque = {0};
    for (int i = 0; i < scene->effects; i++) {
        const effect *e = &scene->effect[i];
        memory *m = &c->memories[i];
        if (!same(m->q, m->goal))
            approach(&m->q, m->goal, c->reference_rate * dt);
        if (nonzero(m->omega) && tick >= m->omega_until)
            m->omega = vec(0.0, 0.0, 0.0);
        double gain = e->gain;
        if (m->age_s < e->fade_s) {
            gain *= m->age_s / e->fade_s;
            m->age_s += dt;
        }
        switch (e->kind) {
        case SPRING:
            torque = add(torque, mul(geodesic(m->q, c->q, &e->matrix, &m->branch), gain));
            break;
        case DAMPER:
            torque = sub(torque, mul(apply(&e->matrix, c->omega), gain));
            break;
        }
    }
    return torque;
}

static inline vec3 wanted(controller *c, const scene *scene, uint64_t tick, double dt, bool changed)
{
    if (c->gain == 0.0) {
        c->offset = c->blended = vec(0.0, 0.0, 0.0);
        c->blend_left = 0.0;
        return vec(0.0, 0.0, 0.0);
    }
    vec3 torque = render(c, scene, tick, dt);
    if (changed) {
        c->offset = sub(c->blended, torque);
        c->blend_left = 1.0;
    } else if (c->blend_left > 0.0) {
        c->blend_left = fmax(c->blend_left - dt / BLEND_S, 0.0);
    }
    if (c->blend_left > 0.0)
        torque = add(torque, mul(c->offset, c->blend_left * c->blend_left * (3.0 - 2.0 * c->blend_left)));
    c->blended = torque;
    if (c->stream_level != 0.0)
        torque = add(torque, mul(c->stream_torque, c->stream_level));
    torque = limited(mul(torque, c->gain), c->torque_limit);
    return add(c->torque, limited(sub(torque, c->torque), c->torque_rate * dt));
}

/* Computes the joint torques with the smallest weighted square sum that produce the torque `t`.
 * Returns false if the driven rows of G are close to losing rank. */
static inline bool allocate(const controller *c, vec3 t, double *tau, double *scale)
{
    int n = 2 * c->device.wheels;
    double give[MAX_JOINTS], size = largest(t);
    sym3 moment = {0}, peaks = {0};
    for (int i = 0; i < n; i++) {
        double peak = c->peak[i], weight = c->weight[i];
        give[i] = 0.0;
        if (peak > 0.0 && peak < INFINITY && weight > 0.0 && weight < INFINITY) {
            give[i] = 1.0 / weight;
            add_outer(&moment, c->rows[i], give[i]);
            add_outer(&peaks, c->rows[i], peak * peak);
        }
    }
    sym3 a = adjugate(&moment), b = adjugate(&peaks);
    double det = determinant(&moment, &a);
    if (!rank_above(&peaks, &b, determinant(&peaks, &b), WHOLE * WHOLE) || !rank_above(&moment, &a, det, 1.0e-6))
        return false;
    vec3 u = mul(t, 1.0 / size), y = mul(times(&a, u), 1.0 / det);
    for (int i = 0; i < n; i++)
        tau[i] = give[i] > 0.0 ? give[i] * dot(c->rows[i], y) : 0.0;
    /* One step of iterative refinement, because the error of the adjugate alone grows with the square
     * of the rows' condition number. */
    vec3 left = u;
    for (int i = 0; i < n; i++)
        left = sub(left, give[i] > 0.0 ? mul(c->rows[i], tau[i]) : vec(0.0, 0.0, 0.0));
    y = mul(times(&a, left), 1.0 / det);
    for (int i = 0; i < n; i++)
        tau[i] += give[i] > 0.0 ? give[i] * dot(c->rows[i], y) : 0.0;
    bool inside = true;
    for (int i = 0; i < n; i++) {
        tau[i] *= size;
        inside &= fabs(tau[i]) <= c->peak[i] || tau[i] == 0.0;
    }
    *scale = 1.0;
    if (!inside) {
        for (int i = 0; i < n; i++)
            if (tau[i] != 0.0)
                *scale = fmin(*scale, c->peak[i] / fabs(tau[i]));
        for (int i = 0; i < n; i++)
            tau[i] *= *scale;
    }
    return true;
}

/* Scales the torques down so that the most loaded contact does not exceed its grip. Returns the load
 * of that contact as a fraction of its grip, at most 1. */
static inline double traction(const controller *c, double *tau, double *scale)
{
    double most = 0.0;
    for (int i = 0; i < c->device.wheels; i++) {
        const wheel *w = &c->device.wheel[i];
        double f2 = tau[2 * i + 1] / w->radius, f1 = (tau[2 * i] + w->arm_cross * f2) / w->arm_steer;
        most = fmax(most, f1 * f1 + f2 * f2);
    }
    double load = sqrt(most) / c->grip;
    if (load > 1.0) {
        for (int i = 0; i < 2 * c->device.wheels; i++)
            tau[i] /= load;
        *scale /= load;
        load = 1.0;
    }
    return load;
}

static __attribute__((noinline)) void tick(controller *c, const scene *scene, const inputs *in, outputs *out)
{
    uint64_t elapsed = c->has_tick ? (in->tick > c->last_tick ? in->tick - c->last_tick : 0) : 1;
    c->has_tick = true;
    c->last_tick = in->tick;
    double dt = (double)(elapsed < 10 ? elapsed : 10) * c->period_s;

    bool fresh;
    enum cause measured = measure(c, in, elapsed, &fresh);
    settle(c, in->tick, powered(c) ? c->align_rate * dt : INFINITY);
    observe(c, fault(c, in, elapsed, measured));
    bool changed = !c->has_revision || c->revision != scene->revision;
    if (changed) {
        c->has_revision = true;
        c->revision = scene->revision;
        for (int i = 0; i < scene->effects; i++)
            c->memories[i] = (memory){.q = scene->effect[i].reference, .goal = scene->effect[i].reference};
    }
    if (in->enable && c->mode == IDLE) {
        for (int i = 0; i < scene->effects; i++) {
            c->memories[i].age_s = 0.0;
            c->memories[i].branch = vec(0.0, 0.0, 0.0);
        }
        c->mode = ENABLING;
        changed = true;
    }
    if (c->mode == ENABLING) {
        c->gain += dt / SOFT_START_S;
        if (c->gain >= 1.0) {
            c->gain = 1.0;
            c->mode = ACTIVE;
        }
    } else if (c->mode != ACTIVE) {
        c->gain = 0.0;
    }

    vec3 want = wanted(c, scene, in->tick, dt, changed);

    int n = 2 * c->device.wheels;
    double tau[MAX_JOINTS] = {0};
    double scale = 1.0, load = 0.0;
    bool deficient = false;
    vec3 torque = {0};
    if (!finite3(want)) {
        observe(c, NON_FINITE);
    } else if (nonzero(want)) {
        if (allocate(c, want, tau, &scale)) {
            load = traction(c, tau, &scale);
        } else {
            memset(tau, 0, sizeof tau);
            scale = 0.0;
            deficient = true;
        }
        bool finite = true;
        for (int i = 0; i < n; i++) {
            torque = add(torque, mul(c->rows[i], tau[i]));
            finite &= isfinite(tau[i]);
        }
        if (!(finite && finite3(torque))) {
            observe(c, NON_FINITE);
            memset(tau, 0, sizeof tau);
            torque = vec(0.0, 0.0, 0.0);
        }
    }
    c->torque = torque;
    sent(c, (uint32_t)in->tick, torque);

    memset(out->drive.torque, 0, sizeof out->drive.torque);
    out->drive.enable = powered(c);
    for (int i = 0; i < n; i++)
        out->drive.torque[i] = signed_by(&c->encoders[i], tau[i]);
    state *s = &out->state;
    s->tick = in->tick;
    s->mode = c->mode;
    s->cause = c->cause;
    s->q = c->q;
    s->omega = c->omega;
    s->torque = torque;
    s->joints = n;
    memcpy(s->angle, c->angle, sizeof s->angle);
    memcpy(s->rate, c->rate, sizeof s->rate);
    memcpy(s->joint_torque, tau, sizeof s->joint_torque);
    s->slip = c->slip;
    s->scale = scale;
    s->traction = load;
    s->energy = c->energy;
    s->deficient = deficient;
    s->fresh = fresh;
}

/* The run. */

static controller the_controller;
static scene the_scene;
static feedback readings[1024];

static void prototype(controller *c)
{
    const double r = 0.0155;
    c->device.radius = 0.102;
    c->device.wheels = 2;
    c->device.wheel[0] = make_wheel(vec(1.0, 0.0, -1.0), 0.1745, 0.0, r, 0.102);
    c->device.wheel[1] = make_wheel(vec(-1.0, 0.0, -1.0), 0.1745, 0.0, r, 0.102);
    c->period_s = 1.0e-3;
    c->timeout_ticks = 20;
    c->torque_limit = 0.9;
    c->torque_rate = 200.0;
    c->speed_limit = 30.0;
    c->slip_limit = 1.0e6;
    c->grip = 0.8 * 10.0;
    c->reference_rate = 2.0;
    c->align_rate = 0.2;
    for (int i = 0; i < c->device.wheels; i++) {
        const wheel *w = &c->device.wheel[i];
        c->peak[2 * i] = 0.93;
        c->peak[2 * i + 1] = 0.14;
        c->weight[2 * i] = 1.0 / (w->arm_steer * w->arm_steer);
        c->weight[2 * i + 1] = 1.0 / (r * r);
        c->encoders[2 * i] = make_encoder(16384, 1.0, false);
        c->encoders[2 * i + 1] = make_encoder(16384, 17.0, false);
    }
    c->q = c->integral = c->correction = (quat){1.0, 0.0, 0.0, 0.0};

    watch *w = &c->watch;
    w->block = (uint32_t)ceil(BLOCK_S / c->period_s - 1.0e-3);
    for (int i = 0; i < c->device.wheels; i++) {
        const wheel *wheel = &c->device.wheel[i];
        double toe = wheel->axis_c1 / wheel->axis_c2, u, v;
        /* The rows of G have the same length at every posture. */
        double rows[2] = {1.0 / fabs(wheel->axis_c2), c->device.radius / wheel->radius * sqrt(toe * toe + 1.0)};
        for (int k = 0; k < 2; k++) {
            w->grain[2 * i + k] = GRAIN * fabs(c->encoders[2 * i + k].radians_per_count);
            w->most[2 * i + k] = IMPOSSIBLE * c->speed_limit * rows[k] * c->period_s;
        }
        wheel_velocity(&c->device, wheel, w->grain + 2 * i, &u, &v);
        w->grain_slip = fmax(w->grain_slip, fabs(u) + fabs(v));
    }
}

static mat3 isotropic(double k) { return (mat3){vec(k, 0.0, 0.0), vec(0.0, k, 0.0), vec(0.0, 0.0, k)}; }

static void run(uint64_t number, outputs *out)
{
    inputs in = {.tick = number, .has_feedback = true, .enable = number == 1};
    in.feedback = readings[number % 1024];
    in.feedback.sequence = (uint32_t)number;
    tick(&the_controller, &the_scene, &in, out);
}

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv)
{
    long ticks = argc > 1 ? atol(argv[1]) : 2000;
    long repetitions = argc > 2 ? atol(argv[2]) : 200;
    long each = argc > 3 ? atol(argv[3]) : 20000;
    if (ticks < 1 || repetitions < 1 || each < 1) {
        fprintf(stderr, "usage: tick [ticks] [repetitions] [ticks a repetition]\n");
        return 2;
    }

    prototype(&the_controller);
    the_scene.revision = 1;
    the_scene.effects = 2;
    the_scene.effect[0] = (effect){SPRING, 1.0, 0.0, isotropic(4.0), {1.0, 0.0, 0.0, 0.0}};
    the_scene.effect[1] = (effect){DAMPER, 1.0, 0.0, isotropic(0.05), {1.0, 0.0, 0.0, 0.0}};
    for (int k = 0; k < 1024; k++)
        for (int i = 0; i < 4; i++) {
            double phase = k * 0.006, swing = 0.3 + 0.1 * i;
            readings[k].counts[i] = (int32_t)(swing * sin(phase + i) * 2000.0);
            /* The joint rate that agrees with these encoder counts at 1 kHz. */
            readings[k].rates[i] = swing * cos(phase + i) * 2000.0 * 6.0 * the_controller.encoders[i].radians_per_count;
        }

    outputs out;
    uint64_t number = 0;
    double sum = 0.0;
    long saturated = 0;
    for (long k = 0; k < ticks; k++) {
        run(number++, &out);
        sum += out.state.torque.x + out.state.torque.y + out.state.torque.z;
        saturated += out.state.scale < 1.0;
    }
    const state *s = &out.state;
    printf("mode %d, %ld of %ld ticks saturated\n", s->mode, saturated, ticks);
    printf("checksum %.15e\n", sum);
    printf("torque %.15e %.15e %.15e\n", s->torque.x, s->torque.y, s->torque.z);
    printf("joints %.15e %.15e %.15e %.15e\n", s->joint_torque[0], s->joint_torque[1], s->joint_torque[2],
           s->joint_torque[3]);
    printf("q %.15e %.15e %.15e %.15e\n", s->q.w, s->q.x, s->q.y, s->q.z);
    printf("omega %.15e %.15e %.15e\n", s->omega.x, s->omega.y, s->omega.z);
    printf("slip %.15e traction %.15e energy %.15e\n", s->slip, s->traction, s->energy);

    double *ns = malloc((size_t)repetitions * sizeof *ns);
    if (!ns)
        return 1;
    for (long i = 0; i < repetitions; i++) {
        double start = now_ns();
        for (long k = 0; k < each; k++) {
            run(number++, &out);
            __asm__ volatile("" : : "r"(&out) : "memory"); /* makes the compiler treat the result as used */
        }
        ns[i] = (now_ns() - start) / (double)each;
    }
    qsort(ns, (size_t)repetitions, sizeof *ns, ascending);
    printf("ns/tick min %.1f median %.1f max %.1f\n", ns[0], ns[repetitions / 2], ns[repetitions - 1]);
    free(ns);
    return 0;
}
