// Watches a running server with Foxglove's own client library, and checks every topic.
//
// Arguments: address of the viewers' port, seconds, and the command that makes an event in the middle of them.
//
// Prints the number of messages of each topic, the ticks that are missing, and whether the time stamps increase. The exit
// code is 0 only if every topic arrives, no tick is missing, and no publisher is accepted.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import WebSocket from "ws";

const require = createRequire(import.meta.url);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const protobuf = require("protobufjs");
const descriptor = require("protobufjs/ext/descriptor");

const [address, seconds, ...command] = process.argv.slice(2);
const EVERY_TICK = ["/hbot/state", "/hbot/joints", "/tf", "/hbot/torque"];
const OTHERS = ["/hbot/event", "/hbot/scene"];

const connect = () =>
  new FoxgloveClient({ ws: new WebSocket(`ws://${address}`, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });
const once = (client, name) => new Promise((resolve) => client.on(name, resolve));
const problems = [];
const check = (holds, what) => holds || problems.push(what);

const client = connect();
client.on("error", (error) => check(false, `error: ${error}`));
client.on("status", (status) => check(false, `status: ${status.message}`));
const [info, channels] = await Promise.all([once(client, "serverInfo"), once(client, "advertise")]);
check(info.capabilities.length === 0, `capabilities: ${info.capabilities}`);

const topics = new Map();
for (const channel of channels) {
  const set = descriptor.FileDescriptorSet.decode(Buffer.from(channel.schema, "base64"));
  const type = protobuf.Root.fromDescriptor(set).lookupType(channel.schemaName);
  topics.set(client.subscribe(channel.id), { name: channel.topic, type, times: [], ticks: [], unstamped: 0 });
}

// Every plot and panel of the layout shows a field that exists.
const layout = JSON.stringify(JSON.parse(readFileSync("contrib/foxglove-layout.json", "utf8")));
const shown = [...layout.matchAll(/"(?:value|topicPath|topicToRender)":"([^"]+)"/g)].map((match) => match[1]);
check(shown.length > 5, "the layout shows hardly anything");
for (const path of shown) {
  const [name, ...fields] = path.replace(/\[\d+\]/g, "").split(".");
  let found = [...topics.values()].find((topic) => topic.name === name)?.type;
  // The library writes names in camel case.
  const camel = (field) => field.replace(/_(.)/g, (_, letter) => letter.toUpperCase());
  for (const field of fields) found = (found?.resolve().resolvedType ?? found)?.fields?.[camel(field)];
  check(found, `the layout shows ${path}, which is no field of a topic`);
}
const nanoseconds = ({ seconds, nanos }) => BigInt(seconds.toString()) * 1000000000n + BigInt(nanos);
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const topic = topics.get(subscriptionId);
  const message = topic.type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  topic.times.push(timestamp);
  if (topic.name === "/hbot/state") topic.ticks.push(Number(message.tick));
  const stamp = message.timestamp ?? message.transforms?.[0]?.timestamp;
  topic.unstamped += nanoseconds(stamp) !== timestamp;
});

const wait = (s) => new Promise((resolve) => setTimeout(resolve, 1000 * s));
await wait(seconds / 2);
if (command.length > 0) execFileSync(command[0], command.slice(1));
await wait(seconds / 2);
client.close();

const found = [...topics.values()];
check(EVERY_TICK.concat(OTHERS).sort().join() === found.map((topic) => topic.name).sort().join(), "other topics");
const { ticks, times } = found.find((topic) => topic.name === "/hbot/state");
const missing = ticks.at(-1) - ticks[0] + 1 - ticks.length;
check(missing === 0, `${missing} ticks are missing`);
const period = (times.at(-1) - times[0]) / BigInt(ticks.at(-1) - ticks[0]);
for (const topic of found) {
  const { name, times, unstamped } = topic;
  const [strict, count] = [EVERY_TICK.includes(name), times.length];
  const unordered = times.filter((time, k) => k > 0 && (strict ? time <= times[k - 1] : time < times[k - 1])).length;
  check(count > (strict ? seconds : 0), `${name}: ${count} messages`);
  // Each topic begins with the first tick after its subscription.
  const lost = strict ? Number((times.at(-1) - times[0]) / period) + 1 - count : 0;
  check(lost === 0, `${name}: ${lost} ticks are missing`);
  check(unordered === 0, `${name}: ${unordered} time stamps do not increase`);
  check(unstamped === 0, `${name}: ${unstamped} messages whose own time is another`);
  const every = strict ? ` of one tick each, ${lost} ticks missing` : "";
  console.log(`${name}: ${count} messages${every}, ${unordered} out of order`);
}
console.log(`ticks ${ticks[0]} to ${ticks.at(-1)}, ${missing} missing, one every ${period} ns`);

// A client that publishes is disconnected.
const publisher = connect();
await once(publisher, "advertise");
const closed = once(publisher, "close");
publisher.sendMessage(publisher.advertise({ topic: "/x", encoding: "json", schemaName: "x" }), new Uint8Array(4));
const { code } = await closed;
check(code === 1003, `a publisher's connection ends with code ${code}`);

for (const problem of problems) console.error(problem);
process.exit(problems.length === 0 ? 0 : 1);
