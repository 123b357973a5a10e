//! Tests of the event that says that the sphere shakes by itself.

use super::*;

fn shaking_event(client: &mut Client) -> hbot_api::ShakingEvent {
    event(client, "shaking event", |event| match event {
        Event::Shaking(shaking) => Some(shaking.clone()),
        _ => None,
    })
}

#[test]
fn a_sphere_that_shakes_by_itself_is_reported_with_the_effect_and_again_when_it_is_calm() {
    // The passivity controller would end the swing before it is reported, and the lead lets none
    // begin.
    let off = ["loop.passivity", "loop.lead"].map(|path| hbot_config::Override {
        path,
        value: json!(false),
        from: "",
    });
    let rig = RigConfig::load(None, &off).expect("a legal rig");
    let bench = TestService::start(TestOptions { rig, ..TestOptions::default() });
    let mut client = bench.active();
    let calm = json!({"id": "calm", "kind": "spring", "anchor": "here", "stiffness": 1, "damping": 0.02});
    let stiff = json!({"id": "stiff", "kind": "spring", "anchor": "here", "stiffness": 300});
    client.call(scene(json!({"name": "x", "effect": [calm, stiff]}))).unwrap();
    bench.with_rig(|rig| {
        let mut state = *rig.state();
        state.omega.y += 0.5;
        rig.set_state(state);
    });
    let found = shaking_event(&mut client);
    assert!(found.shaking && (0.0..=1.0).contains(&found.gain), "{found:?}");
    assert_eq!(found.effect.as_deref(), Some("stiff"), "{found:?}");
    assert!((5.0..100.0).contains(&found.frequency) && (0.2..30.0).contains(&found.amplitude), "{found:?}");
    assert!(found.message.contains("stiff") && found.message.contains("Hz"), "{found:?}");
    // A client that comes later sees why the torque is lowered.
    let mut later = bench.client("later");
    let told = later.info().unwrap().shaking.expect("the torque is lowered");
    assert_eq!((told.shaking, told.effect.as_deref()), (true, Some("stiff")), "{told:?}");
    // With another scene all torque comes back.
    client.call(scene(json!({"name": "y", "effect": [{"id": "soft", "kind": "spring", "anchor": "here", "damping": 0.02}]}))).unwrap();
    let over = loop {
        let event = shaking_event(&mut client);
        if !event.shaking {
            break event;
        }
    };
    assert_eq!((over.gain, over.effect, over.frequency), (1.0, None, 0.0));
    assert!(over.tick > found.tick);
    assert_eq!(later.info().unwrap().shaking, None);
    bench.finish();
}
