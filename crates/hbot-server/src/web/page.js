"use strict";
const state = document.getElementById("state");
const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
const send = (op, fields) => socket.send(JSON.stringify({ id: op, op, ...fields }));
socket.onopen = () => send("hello", { version: 1, name: "page" });
socket.onclose = () => { state.textContent = "NO CONTACT"; };
socket.onmessage = ({ data }) => {
  const message = JSON.parse(data);
  if (message.id === "hello" && message.ok) send("subscribe", { every: 50 });
  if (message.event === "state") state.textContent = JSON.stringify(message, null, 1);
};
