//! WebSocket frames (RFC 6455) as the bytes of the TCP service, and back. Does no I/O.
//!
//! A frame is decoded as its bytes arrive, because the service searches them for stops. A text
//! frame becomes a line, a binary frame becomes a MessagePack map with its length before it.

use hbot_api::{Encoding, MAX_REQUEST_BYTES};

/// Largest number of frames of one message, including control frames between them.
const FRAMES: u32 = 64;
/// Largest payload of a control frame, bytes.
const CONTROL: usize = 125;

const CONTINUATION: u8 = 0;
const TEXT: u8 = 1;
const BINARY: u8 = 2;
const CLOSE: u8 = 8;
const PING: u8 = 9;
const PONG: u8 = 10;

/// How a WebSocket ends: the code and the reason of the close frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Close {
    pub(super) code: u16,
    pub(super) why: &'static str,
    /// True if the client has closed the WebSocket.
    pub(super) by_client: bool,
}

impl Close {
    /// The regular end of a connection by the server.
    pub(super) const NORMAL: Self = Self::of(1000, "");
    /// The end of a client that does not answer pings.
    pub(super) const SILENT: Self = Self::of(1008, "no answer to pings");

    const fn of(code: u16, why: &'static str) -> Self {
        Self { code, why, by_client: false }
    }

    /// Appends the close frame to `out`.
    pub(super) fn frame(self, out: &mut Vec<u8>) {
        head(CLOSE, 2 + self.why.len(), out);
        out.extend_from_slice(&self.code.to_be_bytes());
        out.extend_from_slice(self.why.as_bytes());
    }
}

/// What the next bytes of the client are.
#[derive(Debug)]
enum Part {
    Head,
    /// `left` bytes of the payload of a data frame.
    Data {
        left: usize,
        fin: bool,
        text: bool,
    },
    /// The payload of a control frame, of which `left` bytes are missing.
    Control {
        opcode: u8,
        left: usize,
    },
}

/// Decodes the frames of a client.
#[derive(Debug)]
pub(super) struct Decoder {
    part: Part,
    /// The bytes of a head that has not arrived completely, or the payload of a control frame.
    kept: Vec<u8>,
    mask: [u8; 4],
    /// Index in `mask` of the next byte.
    masked: usize,
    /// Number of bytes and of frames of the message that has not ended. The message is text.
    message: Option<(usize, u32)>,
    /// Bytes that must be put out before the next payload.
    before: &'static [u8],
    length: [u8; 4],
    length_left: usize,
    pong: Option<Vec<u8>>,
    end: Option<Close>,
}

impl Decoder {
    pub(super) fn new() -> Self {
        Self {
            part: Part::Head,
            kept: Vec::with_capacity(CONTROL),
            mask: [0; 4],
            masked: 0,
            message: None,
            before: b"",
            length: [0; 4],
            length_left: 0,
            pong: None,
            end: None,
        }
    }

    /// Returns how the WebSocket ends, once a frame of the client has ended it. No further bytes
    /// are decoded then.
    pub(super) const fn end(&self) -> Option<Close> {
        self.end
    }

    /// Ends the WebSocket.
    pub(super) const fn finish(&mut self, how: Close) {
        self.end = Some(how);
    }

    /// Returns the payload of the newest ping that has not been answered, and forgets it.
    pub(super) const fn take_ping(&mut self) -> Option<Vec<u8>> {
        self.pong.take()
    }

    /// Decodes bytes of `raw` into `out`, in the given encoding of the connection. Returns how many
    /// bytes of `raw` were decoded and how many were written to `out`. Stops when `raw` is used up,
    /// `out` is full or the WebSocket has ended.
    pub(super) fn decode(&mut self, raw: &[u8], out: &mut [u8], encoding: Encoding) -> (usize, usize) {
        let (mut from, mut to) = (0, 0);
        while self.end.is_none() {
            if !self.put_before(out, &mut to) {
                break;
            }
            match self.part {
                Part::Head => {
                    if from == raw.len() {
                        break;
                    }
                    self.kept.push(raw[from]);
                    from += 1;
                    if let Err(how) = self.head(encoding) {
                        self.end = Some(how);
                    }
                }
                Part::Data { left, fin, text } => {
                    let n = left.min(raw.len() - from).min(out.len() - to);
                    if n == 0 && left > 0 {
                        break;
                    }
                    for (to, from) in out[to..to + n].iter_mut().zip(&raw[from..from + n]) {
                        *to = from ^ self.mask[self.masked];
                        self.masked = (self.masked + 1) & 3;
                        // One frame is one message, so a newline in it is a blank.
                        if text && *to == b'\n' {
                            *to = b' ';
                        }
                    }
                    (from, to) = (from + n, to + n);
                    if n < left {
                        self.part = Part::Data { left: left - n, fin, text };
                    } else {
                        self.part = Part::Head;
                        if text && fin {
                            self.before = b"\n";
                        }
                    }
                }
                Part::Control { opcode, left } => {
                    let n = left.min(raw.len() - from);
                    if n == 0 && left > 0 {
                        break;
                    }
                    for byte in &raw[from..from + n] {
                        self.kept.push(byte ^ self.mask[self.masked]);
                        self.masked = (self.masked + 1) & 3;
                    }
                    from += n;
                    if n < left {
                        self.part = Part::Control { opcode, left: left - n };
                    } else {
                        self.part = Part::Head;
                        self.control(opcode, encoding);
                    }
                }
            }
        }
        (from, to)
    }

    /// Writes the bytes that come before the next payload. Returns false if `out` is full.
    fn put_before(&mut self, out: &mut [u8], to: &mut usize) -> bool {
        while let [first, rest @ ..] = self.before {
            let Some(place) = out.get_mut(*to) else { return false };
            (*place, self.before) = (*first, rest);
            *to += 1;
        }
        while self.length_left > 0 {
            let Some(place) = out.get_mut(*to) else { return false };
            *place = self.length[4 - self.length_left];
            self.length_left -= 1;
            *to += 1;
        }
        true
    }

    /// Reads the head of a frame, if it has arrived completely.
    fn head(&mut self, encoding: Encoding) -> Result<(), Close> {
        let &[first, second, ref rest @ ..] = self.kept.as_slice() else { return Ok(()) };
        let (fin, opcode) = (first & 0x80 != 0, first & 0x0f);
        if first & 0x70 != 0 {
            return Err(Close::of(1002, "compressed frames and other extensions are not agreed"));
        }
        if second & 0x80 == 0 {
            return Err(Close::of(1002, "a client's frame is masked"));
        }
        let short = usize::from(second & 0x7f);
        let control = opcode >= CLOSE;
        if control && (!fin || short > CONTROL) {
            return Err(Close::of(1002, "a control frame is whole and has at most 125 bytes"));
        }
        let extended = match short {
            126 => 2,
            127 => 8,
            _ => 0,
        };
        if rest.len() < extended {
            return Ok(());
        }
        let length = match extended {
            0 => short as u64,
            _ => rest[..extended].iter().fold(0, |length, byte| length << 8 | u64::from(*byte)),
        };
        // Checked before the mask has arrived: too long a frame ends the connection at once.
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        if !control && self.message.map_or(0, |(bytes, _)| bytes).saturating_add(length) > MAX_REQUEST_BYTES {
            return Err(Close::of(1009, "a message has at most 65536 bytes"));
        }
        let Some(mask) = rest.get(extended..).and_then(<[u8]>::first_chunk) else { return Ok(()) };
        (self.mask, self.masked) = (*mask, 0);
        self.kept.clear();
        self.frame(opcode, fin, length, encoding)
    }

    /// Begins a frame whose head is complete.
    fn frame(&mut self, opcode: u8, fin: bool, length: usize, encoding: Encoding) -> Result<(), Close> {
        let json = encoding == Encoding::Json;
        if let Some((_, frames)) = &mut self.message {
            *frames += 1;
            if *frames > FRAMES {
                return Err(Close::of(1008, "a message has too many frames"));
            }
        }
        match (opcode, self.message) {
            (TEXT, None) if json => self.message = Some((length, 1)),
            (TEXT, None) => {
                return Err(Close::of(1003, "the hello has asked for MessagePack: send binary frames"));
            }
            (CONTINUATION, Some((bytes, frames))) => self.message = Some((bytes + length, frames)),
            (BINARY, None) if json => {
                return Err(Close::of(1003, "MessagePack needs a hello with encoding msgpack"));
            }
            (BINARY, None) if fin => {
                self.length = u32::try_from(length).unwrap_or(u32::MAX).to_be_bytes();
                self.length_left = self.length.len();
                self.part = Part::Data { left: length, fin, text: false };
                return Ok(());
            }
            (BINARY, None) => return Err(Close::of(1003, "a MessagePack message is one frame")),
            (CLOSE | PING | PONG, _) => {
                self.part = Part::Control { opcode, left: length };
                return Ok(());
            }
            _ => return Err(Close::of(1002, "this frame is not legal here")),
        }
        if fin {
            self.message = None;
        }
        self.part = Part::Data { left: length, fin, text: true };
        Ok(())
    }

    /// Obeys a control frame, whose payload is in `kept`.
    fn control(&mut self, opcode: u8, encoding: Encoding) {
        match opcode {
            CLOSE => self.end = Some(Close { by_client: true, ..Close::NORMAL }),
            PING => self.pong = Some(self.kept.clone()),
            _ => {}
        }
        self.kept.clear();
        // Something that the reader skips, and charges for, so that control frames are limited as
        // requests are. Within a message it would be a part of the message.
        if self.message.is_none() {
            match encoding {
                Encoding::Json => self.before = b"\n",
                Encoding::Msgpack => self.before = &[0; 4],
            }
        }
    }
}

/// Appends the head of a whole frame of the server to `out`.
fn head(opcode: u8, length: usize, out: &mut Vec<u8>) {
    out.push(0x80 | opcode);
    match (u8::try_from(length), u16::try_from(length)) {
        (Ok(short @ ..=125), _) => out.push(short),
        (_, Ok(medium)) => {
            out.push(126);
            out.extend_from_slice(&medium.to_be_bytes());
        }
        _ => {
            out.push(127);
            out.extend_from_slice(&(length as u64).to_be_bytes());
        }
    }
}

/// Appends a ping to `out`.
pub(super) fn ping(out: &mut Vec<u8>) {
    head(PING, 0, out);
}

/// Appends the answer to a ping to `out`.
pub(super) fn pong(payload: &[u8], out: &mut Vec<u8>) {
    head(PONG, payload.len(), out);
    out.extend_from_slice(payload);
}

/// Appends the frame of the first message of `bytes` to `out`. `bytes` are messages of the server,
/// whole ones, each either a line of JSON or a MessagePack map with its length before it. Returns
/// the size of the message, or `None` if it is not whole.
pub(super) fn message(bytes: &[u8], out: &mut Vec<u8>) -> Option<usize> {
    // A line begins with a brace. As the first byte of a length that would be more than a gigabyte.
    if bytes.first() == Some(&b'{') {
        let length = bytes.iter().position(|byte| *byte == b'\n')?;
        head(TEXT, length, out);
        out.extend_from_slice(&bytes[..length]);
        Some(length + 1)
    } else {
        let (length, rest) = bytes.split_first_chunk::<4>()?;
        let length = u32::from_be_bytes(*length) as usize;
        let map = rest.get(..length)?;
        head(BINARY, length, out);
        out.extend_from_slice(map);
        Some(4 + length)
    }
}

#[cfg(test)]
mod tests {
    use tungstenite::protocol::Role;
    use tungstenite::{Message, WebSocket};

    use super::*;

    /// Returns what a client of the library sends for `messages`.
    fn sent(messages: &[Message]) -> Vec<u8> {
        let mut client = WebSocket::from_raw_socket(std::io::Cursor::new(Vec::new()), Role::Client, None);
        for message in messages {
            client.send(message.clone()).unwrap();
        }
        client.into_inner().into_inner()
    }

    /// Decodes `raw` in pieces of `piece` bytes, into a buffer of `room` bytes.
    fn decoded(raw: &[u8], piece: usize, room: usize, encoding: Encoding) -> (Vec<u8>, Decoder) {
        let mut decoder = Decoder::new();
        let mut all = Vec::new();
        for mut piece in raw.chunks(piece) {
            loop {
                let mut out = vec![0; room];
                let (from, to) = decoder.decode(piece, &mut out, encoding);
                all.extend_from_slice(&out[..to]);
                piece = &piece[from..];
                if decoder.end().is_some() || (piece.is_empty() && to < room) {
                    break;
                }
            }
        }
        (all, decoder)
    }

    /// A masked frame of a client.
    fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        head(first & 0x0f, payload.len(), &mut bytes);
        bytes[0] = first;
        bytes[1] |= 0x80;
        bytes.extend_from_slice(&[1, 2, 3, 4]);
        bytes.extend(payload.iter().enumerate().map(|(k, byte)| byte ^ [1, 2, 3, 4][k % 4]));
        bytes
    }

    #[test]
    fn frames_are_lines_in_whatever_pieces_they_come() {
        let long = "x".repeat(300);
        let huge = "y".repeat(65_536);
        let messages = ["{\"op\":\"ping\"}", "a\nb", "", "\u{20ac}", &long, &huge].map(Message::text);
        let raw = sent(&messages);
        let right = format!("{{\"op\":\"ping\"}}\na b\n\n\u{20ac}\n{long}\n{huge}\n");
        for (piece, room) in [(1, 1), (1, 100), (7, 3), (raw.len(), 16), (raw.len(), 1 << 17)] {
            let (all, decoder) = decoded(&raw, piece, room, Encoding::Json);
            assert!(all == right.as_bytes(), "pieces of {piece}, room for {room}");
            assert_eq!(decoder.end(), None);
        }
    }

    #[test]
    fn binary_frames_are_maps_with_their_length() {
        let raw = sent(&[Message::binary(vec![0x81, 10, 7]), Message::binary(vec![0x80; 300])]);
        let right = [&[0, 0, 0, 3, 0x81, 10, 7, 0, 0, 1, 44][..], &[0x80; 300]].concat();
        for (piece, room) in [(1, 1), (5, 4), (raw.len(), 1000)] {
            assert_eq!(decoded(&raw, piece, room, Encoding::Msgpack).0, right);
        }
    }

    #[test]
    fn a_message_in_several_frames_is_one_line_and_a_ping_between_them_is_answered() {
        let raw = [
            frame(TEXT, b"{\"op\":"),
            frame(0x80 | PING, b"p"),
            frame(CONTINUATION, b"\"pi"),
            frame(0x80 | CONTINUATION, b"ng\"}"),
        ]
        .concat();
        for piece in [1, raw.len()] {
            let (all, mut decoder) = decoded(&raw, piece, 4, Encoding::Json);
            assert_eq!(String::from_utf8(all).unwrap(), "{\"op\":\"ping\"}\n");
            assert_eq!((decoder.take_ping(), decoder.take_ping()), (Some(b"p".to_vec()), None));
        }
    }

    #[test]
    fn what_is_not_agreed_ends_the_connection() {
        let json = |raw: &[u8]| decoded(raw, 1, 100, Encoding::Json).1.end().map(|how| how.code);
        assert_eq!(json(&frame(0xc0 | TEXT, b"x")), Some(1002), "compressed");
        assert_eq!(json(&[0x81, 0x01, b'x']), Some(1002), "not masked");
        assert_eq!(json(&frame(0x85, b"x")), Some(1002), "an unknown opcode");
        assert_eq!(json(&frame(0x80, b"x")), Some(1002), "it continues nothing");
        assert_eq!(json(&[frame(TEXT, b"x"), frame(0x81, b"x")].concat()), Some(1002), "two at a time");
        assert_eq!(json(&frame(PING, b"x")), Some(1002), "half a ping");
        assert_eq!(json(&[0x89, 0xfe, 0, 126]), Some(1002), "a long ping");
        assert_eq!(json(&frame(0x82, b"x")), Some(1003), "MessagePack that was not asked for");
        assert_eq!(json(&[0x81, 0xff, 0, 0, 0, 0, 0, 0x10, 0, 0]), Some(1009), "a megabyte");
        assert_eq!(json(&[0x81, 0xff, 255, 255, 255, 255, 255, 255, 255, 255]), Some(1009));
        let long = [frame(TEXT, &[b'x'; 65_000]), frame(CONTINUATION, &[b'x'; 1000])].concat();
        assert_eq!(json(&long), Some(1009), "a long message in frames");
        let many = [frame(TEXT, b""), frame(CONTINUATION, b"").repeat(64)].concat();
        assert_eq!(json(&many), Some(1008), "many frames");
        let msgpack = |raw: &[u8]| decoded(raw, 1, 100, Encoding::Msgpack).1.end().map(|how| how.code);
        assert_eq!(msgpack(&frame(0x81, b"{}")), Some(1003), "JSON where MessagePack was asked for");
        assert_eq!(msgpack(&frame(BINARY, b"x")), Some(1003), "half a map");
        let (_, decoder) = decoded(&frame(0x88, &1001_u16.to_be_bytes()), 1, 9, Encoding::Json);
        assert!(decoder.end().is_some_and(|how| how.by_client));
    }

    /// Control frames are charged for as the bytes that the reader skips.
    #[test]
    fn control_frames_become_bytes_that_are_skipped() {
        let raw = [frame(0x80 | PING, b"abc"), frame(0x80 | PONG, b"")].concat();
        assert_eq!(decoded(&raw, 3, 9, Encoding::Json).0, b"\n\n");
        assert_eq!(decoded(&raw, 3, 9, Encoding::Msgpack).0, [0; 8]);
    }

    #[test]
    fn messages_of_the_server_are_read_by_the_library() {
        let mut bytes = Vec::new();
        for size in [0, 1, 125, 126, 65_535, 65_536, 1 << 20] {
            let text = format!("{{{}\n", "x".repeat(size));
            assert_eq!(message(text.as_bytes(), &mut bytes), Some(size + 2));
            let map = [&u32::try_from(size).unwrap().to_be_bytes()[..], &vec![7; size]].concat();
            assert_eq!(message(&map, &mut bytes), Some(size + 4));
            assert_eq!(message(&map[..map.len() - 1], &mut Vec::new()), None);
        }
        ping(&mut bytes);
        pong(b"abc", &mut bytes);
        Close::SILENT.frame(&mut bytes);
        let mut client = WebSocket::from_raw_socket(std::io::Cursor::new(bytes), Role::Client, None);
        for size in [0, 1, 125, 126, 65_535, 65_536, 1 << 20] {
            assert_eq!(client.read().unwrap().into_text().unwrap().len(), size + 1);
            assert_eq!(client.read().unwrap().into_data().len(), size);
        }
        assert!(client.read().unwrap().is_ping());
        assert_eq!(client.read().unwrap().into_data(), &b"abc"[..]);
        let Message::Close(Some(why)) = client.read().unwrap() else { panic!("no end") };
        assert_eq!((u16::from(why.code), why.reason.as_str()), (1008, "no answer to pings"));
    }
}
