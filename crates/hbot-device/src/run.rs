//! A loop for serial ports that implement the traits of embedded-io.

use core::convert::Infallible;

use embedded_io::{Read, ReadReady, Write, WriteReady};

use crate::{Device, Joints};

/// Number of bytes that are read from the port at a time.
const PIECE: usize = 64;

/// Serves `device` on `port` until the port fails. `now_us` returns the time in microseconds, as
/// for [`Device::poll`].
///
/// The loop never waits for the port, so that the watchdog works while the host neither sends nor
/// receives. `now_us` is called in every pass of the loop.
///
/// # Errors
///
/// Returns the error of the port, with the joints switched off.
pub fn run<P, J>(
    device: &mut Device,
    joints: &mut J,
    port: &mut P,
    mut now_us: impl FnMut() -> u32,
) -> Result<Infallible, P::Error>
where
    P: Read + ReadReady + Write + WriteReady,
    J: Joints,
{
    let error = loop {
        if let Err(error) = pass(device, joints, port, &mut now_us) {
            break error;
        }
    };
    device.stop(joints);
    Err(error)
}

/// Takes the bytes that have arrived, and sends the answers.
fn pass<P, J>(
    device: &mut Device,
    joints: &mut J,
    port: &mut P,
    now_us: &mut impl FnMut() -> u32,
) -> Result<(), P::Error>
where
    P: Read + ReadReady + Write + WriteReady,
    J: Joints,
{
    device.poll(now_us(), joints);
    if !port.read_ready()? {
        return Ok(());
    }
    let mut bytes = [0; PIECE];
    let count = port.read(&mut bytes)?;
    for byte in &bytes[..count] {
        let Some(answer) = device.receive(now_us(), *byte, joints) else { continue };
        let mut rest = &answer[..];
        while !rest.is_empty() {
            device.poll(now_us(), joints);
            if port.write_ready()? {
                let written = port.write(rest)?;
                rest = &rest[written..];
            }
        }
    }
    Ok(())
}
