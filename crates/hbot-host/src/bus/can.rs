//! Computes how long frames take on a CAN-FD bus (ISO 11898-1).

/// Number of bits at the start of a frame that are sent at the slow bit rate, for ids of 11 and of
/// 29 bits: start bit, id, and control bits up to the bit rate switch.
const HEAD: [u64; 2] = [17, 36];
/// Number of bits at the end of a frame that are sent at the slow bit rate again: CRC delimiter,
/// acknowledgement and its delimiter, end of frame, and the pause before the next frame.
const TAIL: u64 = 13;

/// Returns the time that a CAN-FD frame with `bytes` data bytes takes, in ns. Bit rates are 1
/// Mbit/s for the id and the end, and 5 Mbit/s for the data. `long_id` means an id of 29 bits
/// instead of 11. `stuffed` adds the largest possible number of stuff bits.
pub(super) const fn can_fd_ns(bytes: u64, long_id: bool, stuffed: bool) -> u64 {
    let head = HEAD[long_id as usize];
    // The fast part has the ESI bit, the length and the data. Then follow the stuff count and the
    // CRC, with a fixed stuff bit before every fourth bit.
    let data = 1 + 4 + 8 * bytes;
    let crc = if bytes > 16 { 21 } else { 17 };
    let check = 4 + crc + 1 + (4 + crc) / 4;
    // A stuff bit follows five equal bits, and can itself begin the next five.
    let (slow, fast) = if stuffed { ((head - 1) / 4, data / 4) } else { (0, 0) };
    1000 * (head + slow + TAIL) + 200 * (data + fast + check)
}

/// Returns the time that a frame of classical CAN with `bytes` data bytes takes, in ns, with an id
/// of 11 bits and at 1 Mbit/s. `stuffed` adds the largest possible number of stuff bits.
pub(super) const fn can_ns(bytes: u64, stuffed: bool) -> u64 {
    // Stuff bits can occur in the start bit, id, flags, length, data and CRC. They cannot occur in
    // the CRC delimiter, the acknowledgement, the end of frame and the pause.
    let head = 34 + 8 * bytes;
    let stuff = if stuffed { (head - 1) / 4 } else { 0 };
    1000 * (head + stuff + 13)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_classical_frame_takes_111_to_135_bits() {
        assert_eq!((can_ns(8, false), can_ns(8, true)), (111_000, 135_000));
    }

    #[test]
    fn a_frame_takes_its_bits() {
        // No data and a short id: 17 + 13 bits of 1 us, then 5 + 21 + 6 bits of 0.2 us.
        assert_eq!(can_fd_ns(0, false, false), 30_000 + 6_400);
        // 64 bytes, a long id and the most stuff bits: 36 + 8 + 13 bits, then 517 + 129 + 25 + 7.
        assert_eq!(can_fd_ns(64, true, true), 57_000 + 135_600);
        // Up to 16 bytes the CRC has 17 bits, and beyond 21: 133 + 27 and 165 + 32 bits.
        assert_eq!(can_fd_ns(16, false, false), 30_000 + 32_000);
        assert_eq!(can_fd_ns(20, false, false), 30_000 + 39_400);
    }
}
