//! The indexes in a recording: one after each chunk, and one at the end.

use std::collections::HashMap;
use std::io::{Read, Seek, SeekFrom};

use mcap::read::parse_record;
use mcap::records::{Record, op};
use mcap::{MAGIC, McapError};

use crate::reader::MAX_RECORD;

/// Bytes of the kind and the length of a record.
const HEAD: usize = 9;
/// Bytes of the footer: a head, the places of two parts of the index, a check code.
const FOOTER: usize = HEAD + 8 + 8 + 4;

/// Returns whether `body` is the index of a chunk: a channel, a length, and as many bytes.
pub(crate) fn is_of_chunk(body: &[u8]) -> bool {
    body.get(2..6).is_some_and(|length| *length == ((body.len() - 6) as u64).to_le_bytes()[..4])
}

/// Returns whether a file has the signature at its end. A pipe has none.
pub(crate) fn has_end(from: &mut (impl Read + Seek)) -> bool {
    let mut end = [0; MAGIC.len()];
    let read = from.seek(SeekFrom::End(-(end.len() as i64))).and_then(|_| from.read_exact(&mut end));
    read.is_ok() && end == *MAGIC && from.stream_position().is_ok_and(|at| at > MAGIC.len() as u64)
}

/// Returns the topics of the channels in the index at the end of a recording. There are none if the
/// file has no index, the index is damaged, or `from` is a pipe. The position stays as it was.
pub(crate) fn channels(from: &mut (impl Read + Seek)) -> Result<HashMap<u16, String>, McapError> {
    let here = from.stream_position()?;
    let index = bytes(from);
    from.seek(SeekFrom::Start(here))?;
    let (index, mut channels) = (index?, HashMap::new());
    let mut rest = index.as_slice();
    while let Some(([opcode, length @ ..], behind)) = rest.split_first_chunk::<HEAD>() {
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let Some((body, behind)) = behind.split_at_checked(length) else { break };
        if *opcode == op::CHANNEL
            && let Record::Channel(channel) = parse_record(*opcode, body)?
        {
            channels.insert(channel.id, channel.topic);
        }
        rest = behind;
    }
    Ok(channels)
}

/// Returns the bytes of the index at the end, up to its check code. There are none if the check
/// code is not theirs.
fn bytes(from: &mut (impl Read + Seek)) -> Result<Vec<u8>, McapError> {
    let mut end = [0; FOOTER + MAGIC.len()];
    from.seek(SeekFrom::End(-(end.len() as i64)))?;
    from.read_exact(&mut end)?;
    let (footer, signature) = end.split_at(FOOTER);
    let Record::Footer(found) = parse_record(op::FOOTER, &footer[HEAD..])? else { return Ok(Vec::new()) };
    let to = from.stream_position()? - (4 + MAGIC.len()) as u64;
    let length = to.saturating_sub(found.summary_start);
    if signature != MAGIC || footer[0] != op::FOOTER || found.summary_start == 0 || length > MAX_RECORD {
        return Ok(Vec::new());
    }
    let mut index = Vec::new();
    from.seek(SeekFrom::Start(found.summary_start))?;
    from.take(length).read_to_end(&mut index)?;
    if crc32fast::hash(&index) != found.summary_crc {
        index.clear();
    }
    Ok(index)
}
