// Runs the clients of docs/websocket.md: in JavaScript in the console of the page, in C# with Mono. Arguments: the program
// hbot, and a folder for files that are not kept.
import { strict as assert } from "node:assert";
import { execFileSync, spawn } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { chromium } from "playwright-core";
import { Server, until } from "./rig.mjs";

const [hbot, work] = process.argv.slice(2);
const server = await Server.start(hbot);
const document = readFileSync("docs/websocket.md", "utf8").replaceAll("127.0.0.1:4269", server.ports.web);
const block = (language) => document.split(`\`\`\`${language}\n`)[1].split("```")[0];

const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"] });
const page = await browser.newPage();
await page.goto(server.page);
const lines = [];
page.on("console", (line) => lines.push(line.text()));
page.on("pageerror", (error) => lines.push(`error: ${error}`));
await page.evaluate(block("javascript"));
await until("states in JavaScript", () => lines.length >= 5);
for (const line of lines) assert.match(line, /^\d+\.?\d* \[.*\] \[.*\]$/);
await browser.close();

writeFileSync(`${work}/watch.cs`, block("csharp"));
execFileSync("mcs", ["-warnaserror", `-out:${work}/watch.exe`, `${work}/watch.cs`], { stdio: "inherit" });
const program = spawn("mono", [`${work}/watch.exe`], { stdio: ["ignore", "pipe", "inherit"] });
process.on("exit", () => program.kill());
let said = "";
program.stdout.on("data", (data) => (said += data));
await until("states in C#", () => said.split('"event":"state"').length > 5);
const first = said.split("\n").slice(0, -1).map(JSON.parse).filter((message) => message.event === "state");
assert(first.every((state) => state.q.length === 4 && state.torque.length === 3), said);
program.kill();
await server.end();
console.log(`clients of docs/websocket.md: ${lines.length} states in JavaScript, ${first.length} in C#`);
