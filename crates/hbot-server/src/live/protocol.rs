//! Foxglove's WebSocket protocol, version 1: the part that shows topics.
//!
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>

use data_encoding::BASE64;
use hbot_record::Topic;
use hbot_record::messages::DESCRIPTORS;
use serde::Deserialize;
use serde_json::json;

/// Names of the protocol that a viewer may ask for. Both mean the same messages; the second is
/// newer.
pub(super) const NAMES: [&str; 2] = ["foxglove.websocket.v1", "foxglove.sdk.v1"];

/// First byte of a binary message with a message of a topic.
const MESSAGE_DATA: u8 = 1;
/// Level of a status message that is a warning.
const WARNING: u8 = 1;

/// What a viewer can request. Other requests of the protocol are for servers with more
/// capabilities.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(super) enum Request {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

/// A topic that a viewer wants, and the number under which it wants its messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub(super) id: u32,
    pub(super) channel_id: u32,
}

/// Returns the number of a topic's channel.
fn channel(topic: Topic) -> u32 {
    topic as u32 + 1
}

/// Returns the topic with this number of its channel.
pub(super) fn topic(channel_id: u32) -> Option<Topic> {
    Topic::LIVE.into_iter().find(|topic| channel(*topic) == channel_id)
}

/// Returns the text that introduces the server. It names no capabilities, so viewers do not offer
/// to publish, to set parameters or to call services.
pub(super) fn server_info(rig: &str) -> String {
    json!({"op": "serverInfo", "name": format!("hbot: {rig}"), "capabilities": []}).to_string()
}

/// Returns the text that lists the topics with their schemas.
pub(super) fn advertise() -> String {
    let schema = BASE64.encode(DESCRIPTORS);
    let channels = Topic::LIVE.map(|topic| {
        json!({
            "id": channel(topic), "topic": topic.name(), "encoding": "protobuf",
            "schemaName": topic.schema(), "schema": schema, "schemaEncoding": "protobuf",
        })
    });
    json!({"op": "advertise", "channels": channels}).to_string()
}

/// Returns the text that says how many messages a viewer has lost. It replaces the one before it.
pub(super) fn dropped(messages: u64) -> String {
    let text = format!("this viewer reads too slowly: {messages} messages of all topics were dropped");
    json!({"op": "status", "level": WARNING, "id": "dropped", "message": text}).to_string()
}

/// Returns the binary message that brings a message of a topic to a subscription.
pub(super) fn message_data(subscription: u32, unix_ns: u64, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + data.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend_from_slice(&subscription.to_le_bytes());
    bytes.extend_from_slice(&unix_ns.to_le_bytes());
    bytes.extend_from_slice(data);
    bytes
}
