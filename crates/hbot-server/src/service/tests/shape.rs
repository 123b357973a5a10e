//! Tests of the form of `info` and `stats` on the wire: names, their order, and
//! which numbers are integers.

use hbot_api::Fault;

use super::*;

/// Returns a description of the form of a message: for a map its names in order, for a list the
/// form of its first entry, for any other value its type. Schemas and scenes are not examined,
/// because they have their own tests.
fn shape(name: &str, value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(_) => "bool".to_owned(),
        Value::Number(number) if number.is_f64() => "real".to_owned(),
        Value::Number(_) => "whole".to_owned(),
        Value::String(_) => "text".to_owned(),
        Value::Array(entries) => {
            format!("[{}]", entries.first().map_or_else(String::new, |entry| shape("", entry)))
        }
        Value::Object(_) if matches!(name, "scene" | "schema") => "map".to_owned(),
        Value::Object(map) => {
            let fields: Vec<_> =
                map.iter().map(|(name, value)| format!("{name}: {}", shape(name, value))).collect();
            format!("{{{}}}", fields.join(", "))
        }
    }
}

fn ask(bench: &TestService, op: &str) -> String {
    let mut raw = greeted(bench);
    shape("", &raw.ask(&format!(r#"{{"id": 1, "op": "{op}"}}"#))["ok"])
}

/// Joins a description of a form that is written over several lines into one line.
fn said(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace("{ ", "{").replace(" }", "}")
}

#[test]
fn info_keeps_its_names_their_order_and_types() {
    let real = bench();
    real.wait_for(Mode::Idle);
    let joint = "{peak: real, continuous: real}";
    let info = |traction: &str, phenomena: &str| {
        said(&format!(
            "{{
                rig: {{
                    name: text, simulated: bool, rate_hz: whole, sphere: {{radius: real, mass: real}},
                    wheels: [{{
                        name: text, axis: [real], cone: real, toe: real, radius: real, steer: {joint}, drive: {joint}
                    }}]
                }},
                clock: {{monotonic_ns: whole, unix_ns: whole}},
                limits: {{
                    torque: real, torque_rate: real, speed: real, slip: real, energy: null, traction: {traction}, passivity: {{allowance: real, store: real, damping: real}},
                    enable_max_angle: real, align_rate: real, reference_rate: real, max_age_ticks: whole
                }},
                render: {{inertia: real, damping: real, stiffness_stable: real, stiffness_most: real, damping_most: real, border: [[real]], rate_pick: null,
                    loop: {{delay_ticks: whole, lag_s: real, lead_s: real, rate_lag_s: real, rate_weights: [],
                        inertia: [real], axes: [[real]]}}
                }},
                accuracy: text, on_client_lost: text,
                effects: [{{name: text, description: text, schema: map}}],
                {phenomena} scenes: [{{file: text, name: text, description: text}}], modes: [{{name: text, sentence: text}}],
                faults: [{{name: text, sentence: text, remedy: text}}], scene: map, warnings: [], advice: [], capability: [real], lease: {{holder: null, session: null}},
                mode: text
            }}"
        ))
    };
    assert_eq!(ask(&real, "info"), info("{mu: real, normal_force: real}", ""));
    let mut rig = RigConfig::prototype();
    rig.rig = rig.rig.with(|parts| parts.limits.traction = None).unwrap();
    let simulated =
        TestService::start(TestOptions { rig, phenomena: Some(Box::new(|_| ())), ..TestOptions::default() });
    simulated.wait_for(Mode::Idle);
    let phenomena = "phenomena: [{name: text, description: text, schema: map}],";
    assert_eq!(ask(&simulated, "info"), info("null", phenomena));
}

#[test]
fn stats_keeps_its_names_their_order_and_types() {
    let bench = bench();
    let times = "{p50: real, p90: real, p99: real, p99_9: real, p99_99: real, max: real, count: whole}";
    let faults = Fault::ALL.map(|fault| format!("{fault}: whole")).join(", ");
    let stats = said(&format!(
        "{{
            ticks: whole, awake_us: {times}, lateness_us: {times}, compute_us: {times}, link_us: {times}, age_us: {times},
            late_ticks: whole, skipped_ticks: whole, missed_ticks: whole, corrupt_frames: whole, foreign_frames: whole,
            send_failures: whole, reopened_ports: whole, dropped_samples: whole,
            faults: {{{faults}}},
            estops: whole, requests: whole,
            refused: {{
                bad_request: whole, unsupported_version: whole, unauthorized: whole, not_holder: whole, busy: whole,
                unknown_effect: whole, out_of_range: whole, faulted: whole, too_large: whole
            }},
            refused_streams: whole, dropped_states: whole, connections: whole, connections_turned_away: whole,
            handshakes_failed: whole, connections_cut: whole, flight_logs: whole, flight_logs_failed: whole,
            recorded_ticks: whole, unrecorded_ticks: whole, recordings_failed: whole, dropped_live: whole
        }}"
    ));
    assert_eq!(ask(&bench, "stats"), stats);
}
