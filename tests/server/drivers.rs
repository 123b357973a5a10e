//! A custom driver under the real server: motors that do not use hbot's protocol.

#[allow(unreachable_pub, reason = "a test has no outside")]
#[path = "../../crates/hbot-host/tests/toy/mod.rs"]
mod toy;

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hbot_api::{Client, TorqueCommand};
use hbot_config::rig::Port;
use hbot_config::{RigConfig, SceneFile};
use hbot_host::bus::conformance::Controllers as _;
use hbot_host::bus::{Expected, Protocol as _};
use hbot_host::line::Line;
use hbot_host::rig::layout::Layout;
use hbot_server::server::{ServerOptions, Time};
use hbot_testing::patience::eventually;
use hbot_testing::prototype::patient;
use hbot_testing::server::{TestServer, any_port};

use toy::Toy;
use toy::motors::HeldMotors;

/// A line in memory to some motors, which the test can also inspect.
#[derive(Clone)]
struct Cable(Arc<Mutex<(HeldMotors, Vec<u8>)>>);

impl Cable {
    fn new(motors: HeldMotors) -> Self {
        Self(Arc::new(Mutex::new((motors, Vec::with_capacity(4096)))))
    }

    fn held(&self) -> MutexGuard<'_, (HeldMotors, Vec<u8>)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn torque(&self) -> Vec<f64> {
        self.held().0.torque(0)
    }
}

impl Line for Cable {
    fn read(&mut self, _now_ns: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let (_, answers) = &mut *self.held();
        let n = answers.len().min(buffer.len());
        buffer[..n].copy_from_slice(&answers[..n]);
        answers.drain(..n);
        Ok(n)
    }

    fn write(&mut self, now_ns: u64, bytes: &[u8]) -> io::Result<usize> {
        let (motors, answers) = &mut *self.held();
        motors.hear(now_ns, bytes, answers);
        Ok(bytes.len())
    }
}

/// Starts a server whose motors are those at the other end of `cable`.
fn served(cable: &Cable) -> TestServer {
    let mut rig = patient();
    rig.link.port = Port::Devices(vec!["toy".to_owned()]);
    let expected = Expected::new("toy", &rig.rig, &Layout::of(&rig), 0);
    let mut line = cable.clone();
    Toy.meet(&mut line, &expected).expect("the motors answer");
    let bus = Toy.bus(Box::new(line), expected);
    let scene = SceneFile::default_scene();
    let options = ServerOptions { buses: Some(vec![bus]), ..ServerOptions::new(rig, scene, Time::Wall) };
    TestServer::start(options, any_port())
}

fn until(cable: &Cable, what: &str, mut push: impl FnMut(), right: impl Fn(&[f64]) -> bool) {
    eventually(what, || {
        push();
        right(&cable.torque())
    });
}

#[test]
fn a_client_s_torque_reaches_motors_of_another_protocol_and_a_stop_takes_it_from_them() {
    let rig = RigConfig::prototype().rig;
    let cable = Cable::new(HeldMotors::new(rig.joints[..4].iter().map(|j| j.counts_per_turn).collect()));
    let server = served(&cable);
    let mut client = Client::connect(&server.address.to_string(), "pusher").expect("it lets clients in");
    client.acquire(false).expect("nobody else is there");
    // The joint torques for 0.1 N m about n2, with all wheels at their initial steer angles.
    let torque = hbot_core::Vec3::new(0.0, 0.1, 0.0);
    let posture = hbot_core::design::kinematics::Posture::new(&rig.device, &[0.0, 0.0]);
    let makes = |joints: &[f64]| (posture.torque_on_sphere(joints) - torque).length();
    let push = |client: &mut Client| {
        // A machine that stands still for 20 ms causes a fault, which is not the subject of this
        // test.
        let _ = client.reset().and_then(|_| client.enable());
        let torque = TorqueCommand { torque: [0.0, 0.1, 0.0], valid_ms: 1000, tick: None, seq: None };
        let _ = client.torque(torque);
    };
    until(&cable, "0.1 N m about n2", || push(&mut client), |joints| makes(joints) < 1e-4);
    client.estop().expect("it is answered");
    until(&cable, "stopped", || (), |joints| joints.iter().all(|torque| *torque == 0.0));
    until(&cable, "again after reset and enable", || push(&mut client), |joints| makes(joints) < 1e-4);
    assert_eq!(server.stop().failed, None);
    assert_eq!(cable.torque(), [0.0; 4], "the server is gone");
}
