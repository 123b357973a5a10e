// Uses the page in a browser as a person would. Arguments: the program hbot, and a folder for pictures.
//
// Prints times beside a reference of this machine. The exit code is 0 only if the page shows, sends and forgets what it
// should: no time decides.
import { strict as assert } from "node:assert";
import { chromium } from "playwright-core";
import { Client, Server, angle, length, quantile, until } from "./rig.mjs";
import { watch } from "./watch.mjs";

const [hbot, pictures] = process.argv.slice(2);
const SIZES = { desk: { width: 1280, height: 800 }, phone: { width: 390, height: 844 } };
// One more for pictures: a telephone that lies.
const SHOWN = { ...SIZES, flat: { width: 640, height: 360 } };

let server = await Server.start(hbot);
const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"] });
const context = await browser.newContext({ viewport: SIZES.desk, colorScheme: "light" });
const page = await context.newPage();
const complaints = [];
page.on("pageerror", (error) => complaints.push(error.stack));
page.on("console", (line) => line.type() === "error" && complaints.push(line.text()));
// What the page shows when a check fails.
process.on("uncaughtException", async (error) => {
  console.error(error.stack, complaints);
  await page.screenshot({ path: `${pictures}/failed.png` }).catch(() => {});
  process.exit(1);
});
await page.addInitScript(watch);

// While the page is changed: its scripts and styles come from this folder, without building the server.
const folder = process.env.HBOT_PAGE;
// Without the first, which must come from the server, or the browser would not let it connect there.
const fresh = (page) => folder && page.route(/\/\w+\.(js|css|svg)$/, (route) => (
  route.fulfill({ path: folder + new URL(route.request().url()).pathname })));
await fresh(page);

/** Takes a picture of the present state at all sizes, in light and dark. */
async function picture(name) {
  for (const [size, viewport] of Object.entries(SHOWN)) {
    await page.setViewportSize(viewport);
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme });
      await page.waitForTimeout(200);
      await page.screenshot({ path: `${pictures}/${name}-${size}${colorScheme === "dark" ? "-dark" : ""}.png` });
      if (size === "desk") await contrasts(`${name}, ${colorScheme}`);
      await wholeLines();
    }
  }
  await page.setViewportSize(SIZES.desk);
  await page.emulateMedia({ colorScheme: "light" });
  // A page that hears nothing draws four times a second.
  await page.waitForTimeout(300);
}
/**
 * Checks that what is written has the contrast that WCAG 2 wants at level AA, and so have STOP and
 * the edges of what can be pressed or changed. What is locked is exempt.
 */
async function contrasts(where) {
  const weak = await page.evaluate(() => {
    // A colour of the page has at most an alpha of 0 or 1.
    const parts = (colour) => {
      const numbers = colour.match(/[\d.]+/g).map(Number);
      return (colour.startsWith("color(") ? numbers : numbers.map((x, k) => (k < 3 ? x / 255 : x)));
    };
    const seen = (colour) => parts(colour)[3] !== 0;
    const light = (colour) => parts(colour).slice(0, 3)
      .map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4))
      .reduce((sum, x, k) => sum + [0.2126, 0.7152, 0.0722][k] * x, 0);
    const ratio = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
    const ground = (it) => {
      for (let at = it; at; at = at.parentElement) {
        const { backgroundColor } = getComputedStyle(at);
        if (seen(backgroundColor)) return backgroundColor;
      }
      return null;
    };
    const locked = (it) => it.closest(":disabled, [inert]") || it.matches("option");
    const found = [];
    for (const it of document.querySelectorAll("body *")) {
      if (!it.checkVisibility() || locked(it)) continue;
      const { color, borderTopColor, fontSize, fontWeight, borderTopWidth } = getComputedStyle(it);
      const [size, bold] = [parseFloat(fontSize), +fontWeight >= 700];
      const least = size >= 24 || (bold && size >= 18.66) ? 3 : 4.5;
      const written = [...it.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
      const name = it.id || `${it.className} ${it.textContent.slice(0, 40)}`;
      if (written && ratio(color, ground(it)) < least) found.push(`${name}: ${ratio(color, ground(it)).toFixed(2)}`);
      if (!it.matches("button, select, input:not([type=range]), textarea")) continue;
      const around = ground(it.parentElement);
      const edge = parseFloat(borderTopWidth) > 0 ? borderTopColor : getComputedStyle(it).backgroundColor;
      if (ratio(edge, around) < 3) found.push(`the edge of ${name}: ${ratio(edge, around).toFixed(2)}`);
    }
    return found;
  });
  assert.deepEqual(weak, [], `contrast: ${where}`);
}
/** Checks that no text of the picture, nor the force at the hand, covers another by more than 2 px. */
async function apart() {
  const over = await page.evaluate(() => {
    const { left, top } = document.querySelector("#sphere").getBoundingClientRect();
    const grip = document.querySelector("#grip");
    const own = grip.getBoundingClientRect();
    const all = [...window.rectangles.sphere, ...(grip.hidden ? [] : [{ text: "grip", left: own.left - left, right: own.right - left,
      top: own.top - top, bottom: own.bottom - top }])];
    return all.flatMap((a, k) => all.slice(k + 1).filter((b) => (
      Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2))
      .map((b) => `${a.text} and ${b.text}`));
  });
  assert.deepEqual(over, []);
}
/**
 * Checks that no line in the box or of the messages is cut through, that no word of a button
 * touches its edge, and that red is for STOP alone, or for a stop that is not confirmed.
 */
async function wholeLines() {
  const [cut, red, edges, folded] = await page.evaluate(() => {
    const linesOf = (it) => {
      const all = document.createTreeWalker(it, NodeFilter.SHOW_TEXT);
      const lines = [];
      while (all.nextNode()) {
        const range = document.createRange();
        range.selectNodeContents(all.currentNode);
        lines.push(...range.getClientRects());
      }
      return lines;
    };
    const text = document.getElementById("details");
    const through = (it) => {
      const bottom = it.getBoundingClientRect().top + it.clientHeight;
      return it.scrollTop > 0 ? [] : linesOf(it).filter((line) => line.top < bottom - 1.5 && line.bottom > bottom + 1.5).map((line) => line.top);
    };
    const near = (it, part = it, gap = 3) => {
      const { left, top } = it.getBoundingClientRect();
      const inner = [left + it.clientLeft, top + it.clientTop];
      const far = [inner[0] + it.clientWidth, inner[1] + it.clientHeight];
      const lines = linesOf(part);
      return lines.length > 1 || lines.some((line) => line.left < inner[0] + gap || line.right > far[0] - gap
        || line.top < inner[1] || line.bottom > far[1]) ? [`${part.id}: ${part.textContent}`] : [];
    };
    const [stop_, keys] = ["stop", "keys"].map((id) => document.getElementById(id));
    const probe = Object.assign(document.createElement("i"), { style: "color: var(--stop)" });
    document.body.append(probe);
    const stop = getComputedStyle(probe).color;
    probe.remove();
    const looks = (it) => ["color", "backgroundColor", "borderTopColor"].map((part) => getComputedStyle(it)[part]);
    return [[text, document.getElementById("messages")].flatMap(through),
      [...document.querySelectorAll("body *")].filter((it) => (
        it.checkVisibility() && !it.closest("#stop") && looks(it).includes(stop))).map((it) => it.id || it.outerHTML),
      [...[...document.querySelectorAll("#orders button, #lease")].flatMap((it) => near(it)), ...near(stop_, keys)],
      text.scrollHeight > text.clientHeight + 1 && !document.getElementById("more").checkVisibility()];
  });
  assert.deepEqual(edges, [], `words at an edge at ${JSON.stringify(page.viewportSize())}`);
  assert(!folded, `a long text without More at ${JSON.stringify(page.viewportSize())}`);
  assert.deepEqual(cut, [], `a line is cut through at ${JSON.stringify(page.viewportSize())}`);
  assert(await page.$eval("#keys", (it) => it.offsetWidth <= it.parentElement.clientWidth),
    `the line below STOP is wider than it at ${JSON.stringify(page.viewportSize())}`);
  const unsure = await page.evaluate(() => document.body.dataset.head === "not-stopped");
  assert.deepEqual(red.filter((id) => !(unsure && ["box", "chip"].includes(id))), [], "red");
}
/** What the box looks like in each state, without its colours. */
const looks = {};
/** Notes the look of the present state, whose word is large and whose torque is that of the state, or which says that it is not known. */
async function look() {
  const [head, size, now, last, ...all] = await page.evaluate(() => {
    const [box, before] = [getComputedStyle(document.getElementById("box")), getComputedStyle(document.getElementById("headline"), "::before")];
    const card = getComputedStyle(document.documentElement).backgroundColor;
    const light = (colour) => colour.match(/[\d.]+/g).slice(0, 3).reduce((sum, x) => sum + +x, 0) / (colour.startsWith("color") ? 3 : 765);
    return [document.getElementById("headline").textContent, getComputedStyle(document.getElementById("headline")).fontSize,
      document.getElementById("now").innerText, document.querySelector("#details .last")?.innerText, before.clipPath, before.borderTopStyle, box.borderTopStyle, box.borderImageSource !== "none",
      // Filled, or about as light as the page.
      Math.abs(light(box.backgroundColor) - light(card)) > 0.1];
  });
  assert(parseFloat(size) >= 28, `${head}: ${size}`);
  const unknown = /^(NO|NOT) /.test(head);
  if (unknown) assert.match(last, /^Last heard: [A-Z]+, \d\.\d\d N m, \d+ s ago$/);
  assert.match(now, unknown ? /^$/ : /^\d\.\d\d\s*N m\s*torque, limit 0\.90$/, `${head}: ${now}`);
  looks[head] = JSON.stringify(all);
}
/** Checks that what is locked is dashed and says why, and what is not locked is neither. */
async function locks() {
  const wrong = await page.evaluate(() => [...document.querySelectorAll("#orders button, #lease, #load")].filter((it) => {
    const { borderTopStyle } = getComputedStyle(it);
    return it.disabled !== (borderTopStyle === "dashed") || (it.disabled && !it.title);
  }).map((it) => it.outerHTML));
  assert.deepEqual(wrong, []);
}
/** Returns which buttons stand out as the next step. */
const next = () => page.$$eval("#orders .next", (all) => all.map((it) => it.id));
/**
 * Checks that nothing of a rig that is not heard looks as if it were, or can be used but for STOP
 * and Disable, which reach a rig that may still hear.
 */
async function grey() {
  const loud = () => page.evaluate(() => [...document.querySelectorAll("#orders button:not(#disable), #lease, #load, #loadtext")]
    .filter((it) => !it.disabled).map((it) => it.id)
    .concat(["torque", "angle"].filter((name) => window.written[name].includes("now")))
    .concat(document.querySelector("#effects").inert ? [] : ["effects"])
    .concat(/drag|turn/i.test(document.querySelector("#hint").textContent) ? ["hint"] : [])
    .concat(document.body.classList.contains("old") ? [] : ["body"])
    .concat(getComputedStyle(document.querySelector("#badge")).backgroundColor
      === getComputedStyle(document.querySelector("#who")).color ? [] : ["badge"]));
  // The plots are drawn in turns.
  for (let k = 0; k < 10 && (await loud()).length > 0; k += 1) await page.waitForTimeout(100);
  assert.deepEqual(await loud(), []);
}
/** Checks that the texts are in sight in the box, at least where they begin. */
const insight = (...texts) => until(`in sight at ${JSON.stringify(page.viewportSize())}: ${texts}`, () => page.evaluate((all) => {
  const box = document.getElementById("box");
  return all.every((text) => {
    const it = [...box.querySelectorAll("#notice span, #details p")].find(({ textContent }) => textContent.includes(text));
    const [{ left, top, right, bottom } = {}] = it?.getClientRects() ?? [];
    const found = [[left + 2, top + 4], [Math.min(right - 2, left + 80), bottom - 4]].map((at) => document.elementFromPoint(...at));
    return found.every((one) => one === it || it.contains(one));
  });
}, texts), 5);
/** Checks that the box is short and the bars are in sight at every size. */
async function short(...texts) {
  for (const [width, height] of [[1280, 800], [1024, 600], [390, 844], [360, 640], [844, 390], [640, 360]]) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(300);
    assert(!await page.locator("#box.long").count(), `the box covers the bars at ${width} x ${height}`);
    await insight(...texts);
  }
  await page.setViewportSize(SIZES.desk);
}
/** Checks that every plot has 0 and another number at its axis of values. */
async function ticks() {
  // Of a new scene the server computes it first.
  await until("a curve", () => page.evaluate(() => !window.written.curves.includes("computing the curve")));
  const written = await page.evaluate(() => window.written);
  for (const name of ["torque", "angle", "curves"]) {
    const numbers = new Set(written[name].filter((it) => /^-?[\d.]+$/.test(it)));
    assert(numbers.has("0") && numbers.size >= 2, `${name}: ${[...numbers]}`);
  }
}
/** Returns where the parts of the page are that must not move when the state changes, at both sizes. */
async function places() {
  const all = [];
  for (const viewport of Object.values(SIZES)) {
    await page.setViewportSize(viewport);
    await page.waitForTimeout(300);
    all.push(await page.evaluate(() => {
      window.scrollTo(0, 0);
      return ["stop", "orders", "box", "distance", "meters", "sphere", "plots"].map((id) => {
        const { x, y, width, height } = document.getElementById(id).getBoundingClientRect();
        // The box grows over the bars.
        return `${id}: ${[x, y, width, id === "box" ? 0 : height].map(Math.round)}`;
      });
    }));
  }
  await page.setViewportSize(SIZES.desk);
  return all;
}
const text = (selector) => page.locator(selector).innerText();
const shows = (selector, part, seconds) =>
  until(`${selector} shows ${part}`, async () => (await text(selector)).includes(part), seconds);
const ms = (x) => `${x.toFixed(1)} ms`;

/** Checks that torque and speed are in sight, which the text must not cover once it is fitted to the window. */
const bars = () => until("torque and speed in sight", () => page.$$eval("meter", (all) => all.slice(0, 2).every((it) => {
  const { x, y, width, height } = it.getBoundingClientRect();
  return document.elementFromPoint(x + width / 2, y + height / 2) === it;
})));
/** Checks that the box has no row without a number, and so has room for all its text. */
const roomy = () => until("neither a row without a number nor More", () => (
  page.$$eval("#kept meter, #more", (all) => !all.some((it) => it.checkVisibility()))));
/** Checks that the text covers torque and speed in no small window, or does another `check` there. */
async function uncovered(check = bars) {
  for (const [width, height] of [[640, 360], [844, 390], [360, 640], [1024, 600]]) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(300);
    await check();
    await wholeLines();
  }
  await page.setViewportSize(SIZES.desk);
}
/** Checks that no word in sight is smaller than 12 px. */
async function legible() {
  const small = await page.evaluate(() => [...document.querySelectorAll("body *")].filter((it) => (
    it.checkVisibility() && [...it.childNodes].some((node) => node.nodeType === 3 && node.data.trim())
    && parseFloat(getComputedStyle(it).fontSize) < 12)).map((it) => it.outerHTML));
  assert.deepEqual(small, [], `below 12 px at ${JSON.stringify(page.viewportSize())}`);
}
/** Returns what the line below STOP says from now on, in a list that grows. */
const spoken = () => page.evaluateHandle(() => {
  const all = [];
  const keys = document.getElementById("keys");
  new MutationObserver(() => all.push(keys.textContent)).observe(keys, { childList: true });
  return all;
});
const UNHEARD = "No answer: may not reach the rig";

// The first picture.
await page.goto(server.page);
await until("a first state", () => page.evaluate(() => document.querySelector("#sphere").dataset.tick));
// The browser may note them a moment after that.
const first = await until("a first picture", () => page.evaluate(
  () => performance.getEntriesByName("first-contentful-paint")[0]?.startTime));
const state = await until("the time of the first state", () => page.evaluate(() => window.firstTick));
console.log(`first picture ${ms(first)} after the request (wanted: 1000), with a state after ${ms(state)}`);

// It observes until somebody takes command.
const watcher = await Client.connect(server.listen, "watcher");
await shows("#headline", "ACTIVE");
assert.equal(await text("#badge"), "SIMULATED");
assert.equal(await text("#who"), "nobody commands");
assert.equal((await watcher.ask("info")).lease.holder, null, "a page that is opened takes nothing");
await shows("#effects", "stiffness");
assert(await page.locator("#effects").evaluate((it) => it.inert), "an observer changes nothing");
assert(await page.locator("#who.warn").count(), "what pushes is commanded by nobody");
const free = "Nobody commands. The sphere pushes on; STOP and Disable work.";
await shows("#details", free);
assert.equal(await text("#details"), free, "in place of the sentence of the mode");
assert.deepEqual(await page.evaluate(() => {
  const { color, fontSize, fontWeight } = getComputedStyle(document.querySelector("#details p"));
  const probe = Object.assign(document.createElement("i"), { style: "color: var(--warn)" });
  document.body.append(probe);
  return [color === getComputedStyle(probe).color, fontSize, fontWeight];
}), [true, "16px", "700"]);
await page.waitForTimeout(3000);
await picture("observing");
await ticks();
await apart();

// The first screen has the messages too, and the left column is used to its end.
assert(await page.evaluate(() => {
  const [first, list] = ["#messages li", "#messages"].map((it) => document.querySelector(it).getBoundingClientRect());
  return first.top > 0 && first.bottom <= innerHeight && innerHeight - list.bottom < 20;
}), "the messages are in sight");
assert.equal(await page.locator("header").evaluate((it) => getComputedStyle(it).boxShadow), "none", "the line of a real rig");

// Every control has a name, and nothing is wider than a small telephone.
const nameless = await page.$$eval("button, input, select, textarea, canvas, summary", (all) => all
  .filter((it) => it.offsetParent && !(it.getAttribute("aria-label") || it.textContent.trim() || it.labels?.length))
  .map((it) => it.outerHTML));
assert.deepEqual(nameless, []);
// What is written on them is explained, to the eye as to the ear.
for (const id of ["sphere", "torque", "angle", "curves"]) {
  const [told, title] = await page.locator(`#${id}`).evaluate((it) => [it.getAttribute("aria-describedby").split(" ")
    .map((id) => document.getElementById(id).textContent).join(" "), it.title]);
  for (const term of ["N: the frame of the rig", "n1", "s1"]) assert(told.includes(term), `${id}: ${told}`);
  if (id !== "sphere") assert(told.endsWith(title) && title, `${id}: ${title}`);
}
assert((await page.locator("#legend").getAttribute("title")).startsWith("N: "));
assert(await page.evaluate(() => ["wheel A", "wheel B"].every((it) => window.written.sphere.includes(it))), "a letter alone");
await page.setViewportSize({ width: 360, height: 640 });
await page.waitForTimeout(200);
const wide = await page.evaluate(() => document.documentElement.scrollWidth);
assert(wide <= 360, `${wide} px at a width of 360`);

// STOP is in sight wherever the page is scrolled: on telephones, tablets and flat windows.
for (const [width, height] of [[390, 844], [820, 1100], [844, 390], [1280, 800]]) {
  await page.setViewportSize({ width, height });
  await page.evaluate(() => document.querySelector("#messages").scrollIntoView());
  await page.waitForTimeout(200);
  const under = await page.evaluate(() => {
    const { x, y, width: w, height: h } = document.querySelector("#stop").getBoundingClientRect();
    return document.elementFromPoint(x + w / 2, y + h / 2)?.id;
  });
  assert.equal(under, "stop", `at ${width} x ${height}`);
  const [low, high] = await page.evaluate(() => ["bottom", "top"].map((side, k) => (
    document.querySelector(["#legend", "#sphere"][k]).getBoundingClientRect()[side])));
  assert(low <= high, `at ${width} x ${height} the legend ends at ${low} px, and the picture begins at ${high} px`);
}
// What a person looks at is in one window on telephones too, and nothing covers it.
for (const [width, height] of [[390, 844], [844, 390], [360, 640], [320, 640], [640, 360]]) {
  await page.setViewportSize({ width, height });
  await page.evaluate(() => window.scrollTo(0, 0));
  await page.waitForTimeout(300);
  const covered = await page.evaluate(() => ["chip", "stop", "orders", "box", "meters", "sphere"].filter((id) => {
    const it = document.getElementById(id);
    const { left, right, top, bottom } = it.getBoundingClientRect();
    const [x, y] = [(left + right) / 2, (top + bottom) / 2];
    return [[x, top + 3], [x, bottom - 3]].some((at) => !it.contains(document.elementFromPoint(...at)));
  }));
  assert.deepEqual(covered, [], `at ${width} x ${height}`);
  const beyond = await page.evaluate(() => window.beyond);
  assert.deepEqual(beyond, {}, `written beyond the edge at ${width} x ${height}`);
  await legible();
}
await page.setViewportSize(SIZES.desk);
await page.evaluate(() => document.querySelector("#scene").scrollIntoView());

// A finger finds the button of the command, although it is small on telephones.
for (const [width, height] of [[390, 844], [360, 640]]) {
  await page.setViewportSize({ width, height });
  await page.evaluate(() => window.scrollTo(0, 0));
  await page.waitForTimeout(200);
  const found = await page.evaluate(() => {
    const { x, y, width: w, height: h } = document.querySelector("#lease").getBoundingClientRect();
    const hits = (dy) => document.elementFromPoint(x + w / 2, y + h / 2 + dy)?.id === "lease";
    return Array.from({ length: 61 }, (_, k) => k - 30).filter(hits).length;
  });
  assert(found >= 44, `the button is ${found} px high at ${width} x ${height}`);
  // Nor does it miss anything else, or zoom into a field.
  const small = await page.$$eval("button, select, input, summary, textarea", (all) => all.filter((it) => {
    const { width: w, height: h } = (it.closest("label") ?? it).getBoundingClientRect();
    const zooms = it.matches("select, input, textarea") && parseFloat(getComputedStyle(it).fontSize) < 16;
    return it.checkVisibility() && (w < 44 || h < 44 || zooms);
  }).map((it) => it.outerHTML));
  assert.deepEqual(small, [], `at ${width} x ${height}`);
}
await page.setViewportSize(SIZES.desk);

// How old a state is when the page has painted it. What the browser's compositor adds until the screen shows it, about
// 6 ms, is not in it.
const { pictures: drawn, states, clocks } = await (async () => {
  const done = page.evaluate(() => window.measure(4000));
  // The time of the simulated rig waits while the machine is busy, and the clock of tick 0 moves by each wait. With a
  // clock from before a wait, the wait would count as age of all later states.
  const clocks = [];
  let measures = true;
  done.finally(() => { measures = false; });
  while (measures) {
    const { clock } = await watcher.ask("info");
    clocks.push({ tick: watcher.state.tick, origin: clock.unix_ns / 1e6 });
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  return { ...await done, clocks };
})();
const ages = drawn.map(([tick, now]) => now - tick - (clocks.findLast((clock) => clock.tick <= tick) ?? clocks[0]).origin);
const waited = clocks.at(-1).origin - clocks[0].origin;
console.log(`state to picture: median ${ms(quantile(ages, 0.5))}, 90 % ${ms(quantile(ages, 0.9))} (wanted: 35; `
  + `a frame lasts 16.7); ${(states / 4).toFixed(0)} states and ${(drawn.length / 4).toFixed(0)} pictures a second; `
  + `the rig's time waited ${waited.toFixed(0)} ms`);
assert(states <= 4 * 75, `${states} states in 4 s: the page asks for about 60 a second`);

// States that came while the page could not draw are not drawn later.
await page.evaluate(() => window.block(1500));
const resumed = watcher.state.tick;
await page.waitForTimeout(1000);
const late = await page.evaluate((tick) => window.late.filter((it) => it < tick - 50).length, resumed);
// About 94 came.
assert(late <= 10, `${late} pictures of states from before the end of a pause`);

// One button, which says what it will do and keeps its place. The second click of two releases nothing.
await locks();
await look();
const button = async () => [await text("#lease"), JSON.stringify(await page.locator("#lease").boundingBox())];
const [takes, where] = await button();
assert.equal(takes, "Take command");
await page.evaluate(() => {
  const lease = document.getElementById("lease");
  new MutationObserver((_, it) => {
    it.disconnect();
    lease.click();
  }).observe(lease, { childList: true });
});
await page.click("#lease");
await shows("#who", "you command");
assert.deepEqual(await button(), ["Release command", where]);
await page.waitForTimeout(800);
await shows("#who", "you command");
await page.click("#lease");
await shows("#who", "nobody commands");
await page.click("#lease");
await shows("#who", "you command");
await locks();
await until("the lease", async () => (await watcher.ask("info")).lease.holder === "Chrome on Linux");

// A plot holds its scale until it is clicked. The sphere swings with less than half the limit.
const scale = () => page.evaluate(() => window.written.torque.find((it) => it.includes("\u00b1"))?.match(/\u00b1\S+/)[0]);
assert.equal(await scale(), "\u00b11");
await page.click("#torque");
await until("a fitted scale", async () => /^\u00b10\.[125]$/.test(await scale()), 5);
await page.focus("#torque");
await page.keyboard.press("Enter");
await until("the usual scale", async () => (await scale()) === "\u00b11", 5);

// The hand turns the sphere, and the spring turns the hand.
const middle = await page.locator("#sphere").boundingBox().then((box) => ({
  x: box.x + box.width / 2, y: box.y + box.height / 2,
  radius: Math.max(Math.min(box.width, box.height) / 2 / 1.62, (Math.min(box.width, box.height) / 2 - 20) / 1.25) }));
async function settled() {
  let still = 0;
  await until("the sphere rests", () => {
    still = length(watcher.state.omega) < 2e-3 ? still + 1 : 0;
    return still > 10;
  });
  return watcher.state;
}
async function drag(part, steps = 12) {
  await page.mouse.move(middle.x, middle.y);
  await page.mouse.down();
  await page.mouse.move(middle.x + part * middle.radius, middle.y, { steps });
}
// At every moment the box and the arrow say one torque.
const torques = page.evaluate(() => new Promise((resolve) => {
  const pairs = [];
  const note = () => {
    const arrow = window.written.sphere.find((it) => /^\d\.\d\d N m$/.test(it));
    if (arrow) pairs.push([arrow, `${document.querySelector("#now b").textContent} N m`]);
    if (pairs.length < 60) requestAnimationFrame(note);
    else resolve(pairs);
  };
  note();
}));
await drag(0.6);
const pairs = await torques;
assert(new Set(pairs.map(([arrow]) => arrow)).size > 3, "a torque that changes");
assert.deepEqual(pairs.filter(([arrow, box]) => arrow !== box), [], "two torques");
await shows("#grip", "at your hand");
const held = await settled();
const stiffness = (await watcher.ask("info")).scene.effect[0].stiffness;
const turned = angle(held.q, held.reference);
const ratio = length(held.torque) / (stiffness * turned);
console.log(`a drag by 0.6 of the radius: ${turned.toFixed(3)} rad and ${length(held.torque).toFixed(3)} N m, `
  + `${((ratio - 1) * 100).toFixed(2)} % from the spring's ${stiffness} N m/rad`);
assert(turned > 0.1, "the sphere turns with the pointer");
assert(Math.abs(ratio - 1) < 0.02, `the spring is felt: ${ratio}`);
const shown = parseFloat((await text("#grip")).match(/([\d.]+) N m/)[1]);
assert(Math.abs(shown - length(held.torque)) < 0.005, `the page shows ${shown} N m`);
const label = await page.locator("#grip").boundingBox();
const off = Math.hypot(label.x + label.width / 2 - middle.x, label.y + label.height / 2 - middle.y);
assert(off < 1.2 * middle.radius, `the force stands ${off} px from the middle of the sphere`);
await picture("hand");
await apart();
// The arrow of the torque has its number.
await until("the torque at its arrow", () => page.evaluate(() => window.written.sphere.some((it) => /^\d\.\d\d N m$/.test(it))));
assert.equal(await scale(), "\u00b11");
// The wheel twists the held sphere about the line of sight.
await page.mouse.wheel(0, -200);
await until("the wheel twists it", () => angle(watcher.state.q, held.q) > 0.1);
await page.mouse.up();
await until("the sphere turns back", () => angle(watcher.state.q, watcher.state.reference) < 0.5 * turned);

// With Shift, a drag turns the view and not the sphere.
const rest = (await settled()).q;
await page.keyboard.down("Shift");
await drag(0.5);
await page.mouse.up();
await page.keyboard.up("Shift");
assert(angle((await settled()).q, rest) < 0.02, "Shift turns the view");
await page.locator("#sphere").dblclick({ position: { x: 5, y: 5 } });

// The arrow keys turn the sphere too, and let go when they are released.
await page.focus("#sphere");
await page.keyboard.down("ArrowRight");
await until("the key turns the sphere", () => angle(watcher.state.q, watcher.state.reference) > 0.1);
await page.keyboard.up("ArrowRight");
await until("it turns back", () => angle(watcher.state.q, watcher.state.reference) < 0.05);

// A finger does what the mouse does, and two fingers turn the view.
const screen = await context.newCDPSession(page);
const touch = (type, ...points) => screen.send("Input.dispatchTouchEvent", {
  type, touchPoints: points.map(([dx, dy], id) => ({ x: middle.x + dx * middle.radius, y: middle.y + dy * middle.radius, id })) });
await touch("touchStart", [0, 0]);
for (let k = 1; k <= 6; k += 1) await touch("touchMove", [0.1 * k, 0]);
await until("a finger turns the sphere", () => angle(watcher.state.q, watcher.state.reference) > 0.1);
await touch("touchStart", [0.6, 0], [0, 0.5]);
await until("a second finger lets go", () => !watcher.state.hand);
await touch("touchEnd");

// A move that fails holds nobody: the hand lets go, also if the person has let go meanwhile.
for (const kinds of [["pointermove"], ["pointermove", "pointerup"]]) {
  await page.mouse.move(middle.x, middle.y);
  await page.mouse.down();
  await until("the hand holds", () => watcher.state.hand);
  await page.waitForTimeout(300);
  await page.evaluate(([all, clientX, clientY]) => {
    window.spoils = true;
    for (const kind of all) {
      document.querySelector("#sphere").dispatchEvent(new PointerEvent(kind, { pointerId: 1, clientX, clientY }));
    }
    window.spoils = false;
  }, [kinds, middle.x + 20, middle.y]);
  await until(`the hand lets go after ${kinds}`, () => !watcher.state.hand, 5);
  await page.mouse.up();
}

// Sliders: the server has the new value, and the mark of stability follows the damping.
const slider = page.getByRole("slider", { name: "spring stiffness" });
const mark = () => page.locator("#effects .mark").first().evaluate((it) => it.style.left);
const marked = await mark();
await slider.focus();
for (let k = 0; k < 8; k += 1) await page.keyboard.press("ArrowRight");
await until("a stiffer spring", async () => (await watcher.ask("info")).scene.effect[0].stiffness > stiffness);
const damping = page.getByRole("spinbutton", { name: "spring damping value" });
await damping.fill("0.03");
await damping.press("Enter");
await until("more damping", async () => (await watcher.ask("info")).scene.effect[0].damping === 0.03);
await until("the mark follows", async () => (await mark()) !== marked);
// It has its number, and is in sight above and below the handle.
assert.equal(await page.locator("#effects .mark").first().getAttribute("data-at"),
  (await text("#effects details:first-of-type p")).match(/stable up to ([\d.]+)/)[1]);
const [line, handle, shownAt] = await page.locator("#effects .mark").first().evaluate((it) => [
  it.getBoundingClientRect(), it.parentElement.querySelector("input").getBoundingClientRect(),
  getComputedStyle(it, "::before").content].map((it) => (it.top === undefined ? it : { top: it.top, bottom: it.bottom })));
const half = (handle.top + handle.bottom) / 2;
assert(line.top <= half - 12 && line.bottom >= half + 12, JSON.stringify([line, handle]));
assert.match(shownAt, /\d/);
const number = page.getByRole("spinbutton", { name: "spring stiffness value" });
// A sphere that swings would shake at once.
await until("rest", () => Math.hypot(...watcher.state.omega) < 0.01 && angle(watcher.state.q, watcher.state.reference) < 0.01);
await number.fill("200");
await number.press("Enter");
await shows("#warnings", "spring: may shake");
await shows("#details", "Warning: spring: may shake the sphere at its rest.");
for (const place of ["#warnings", "#details"]) assert.match(await text(place), /^Set stiffness = /, "what to do comes first");
// The box has the colour of its worst, and all its words.
const edge = () => page.evaluate(() => {
  const warn = getComputedStyle(document.documentElement).getPropertyValue("--warn").trim();
  const is = (it) => getComputedStyle(it).getPropertyValue("--say").trim() === warn;
  return is(document.getElementById("box"));
});
for (const [width, height] of [[1280, 800], [1024, 600], [390, 844], [360, 640], [844, 390]]) {
  await page.setViewportSize({ width, height });
  await page.waitForTimeout(300);
  assert(await edge(), "a warning in green");
  const [over, long] = await page.evaluate(() => {
    const box = document.getElementById("box");
    const cut = (it) => it.scrollHeight > it.clientHeight + 1 || it.scrollWidth > it.clientWidth + 1;
    return [[box, ...box.querySelectorAll("p")].filter((it) => it.textContent && cut(it)).map((it) => it.textContent),
      box.classList.contains("long")];
  });
  assert.deepEqual([over, long], [[], false], `the warning at ${width} x ${height}`);
}
await page.setViewportSize(SIZES.desk);
await picture("warned");
await number.fill("2");
await number.press("Enter");
await until("no warning", async () => (await text("#warnings")) === "");
await until("no amber", async () => !await edge());

// A slider of many decades is logarithmic, with 0 at its end, and says its value with the unit.
const at = {};
for (const value of [0.1, 1, 10]) {
  await number.fill(`${value}`);
  await number.press("Enter");
  await until(`${value} N m/rad`, async () => (await watcher.ask("info")).scene.effect[0].stiffness === value);
  assert.equal(await slider.getAttribute("aria-valuetext"), `${value} N m/rad`);
  at[value] = +await slider.inputValue();
}
assert(Math.abs((at[10] - at[1]) - (at[1] - at[0.1])) <= 1 && at[10] > at[1] + 50, JSON.stringify(at));
for (const [key, value] of [["Home", 0], ["ArrowRight", 0.1]]) {
  await slider.press(key);
  await until(`${key}: ${value} N m/rad`, async () => (await watcher.ask("info")).scene.effect[0].stiffness === value);
}
await number.fill("2");
await number.press("Enter");
// A slip of the pen is no wish for the stiffest spring that there is.
for (const wrong of ["5000", "-5"]) {
  await number.fill(wrong);
  await number.press("Enter");
  assert(await number.evaluate((it) => it.matches(":invalid")), `${wrong} is marked`);
  await page.waitForTimeout(100);
  assert.equal((await watcher.ask("info")).scene.effect[0].stiffness, 2, wrong);
}
await number.blur();
assert.equal(await number.inputValue(), "2", "what the rig has");

// What slips changes nothing: a press beside the handle, a finger that scrolls, a wheel over the number, a key that leaps.
const grip = async () => {
  const at = await slider.boundingBox();
  const share = await slider.evaluate((it) => it.value / it.max);
  return { x: at.x + 8 + share * (at.width - 16), y: at.y + 0.5 * at.height, end: at.x + at.width - 12 };
};
const stiff = async () => (await watcher.ask("info")).scene.effect[0].stiffness;
await until("2 N m/rad", async () => (await stiff()) === 2);
const here = await grip();
await page.mouse.click(here.end, here.y);
await slider.press("End");
const swipe = (type, ...points) => screen.send("Input.dispatchTouchEvent", { type, touchPoints: points });
for (const place of ["end", "x"]) {
  const { y, [place]: x } = await grip();
  await swipe("touchStart", { x, y });
  for (let k = 1; k <= 8; k += 1) await swipe("touchMove", { x: x + k, y: y - 20 * k });
  await swipe("touchEnd");
  await page.evaluate(() => scrollTo(0, 0));
}
await number.fill("");
await number.pressSequentially("15");
await number.hover();
await page.mouse.wheel(0, -100);
await page.waitForTimeout(300);
assert.equal(await stiff(), 2, "a slip");
const from = await grip();
await page.mouse.move(from.x, from.y);
await page.mouse.down();
await page.mouse.move(from.x + 12, from.y, { steps: 4 });
await page.mouse.up();
await until("a drag of the handle", async () => (await stiff()) > 2);
await number.fill("2");
await number.press("Enter");

// Another scene, by its name and as text. No curve of the old scene stands below the new title.
await until("a curve", () => page.evaluate(() => !window.written.curves.includes("computing the curve")));
await page.evaluate(() => {
  new MutationObserver((_, it) => {
    it.disconnect();
    window.below = window.written.curves;
  }).observe(document.querySelector("#scene"), { childList: true });
});
await page.selectOption("#shelf", "hinge");
await page.click("#load");
await shows("#scene", "Hinge");
const below = await page.evaluate(() => window.below);
assert(below.includes("computing the curve"), `${below}`);
await until("the new curve", () => page.evaluate(() => !window.written.curves.includes("computing the curve")));
const load = async (scene) => {
  await page.locator("#astext").evaluate((it) => (it.open = true));
  await page.fill("#text", JSON.stringify(scene));
  await page.click("#loadtext");
  await shows("#scene", scene.name);
  await page.locator("#astext").evaluate((it) => (it.open = false));
};
const spring = { id: "spring", kind: "spring", law: "geodesic", stiffness: 1, damping: 0.02, anchor: "here" };
await load({ name: "As text", effect: [spring] });
await watcher.mode("active");

// The mark is that of the whole scene: it follows the stiffness of another spring, and is what the server says.
const told = async () => (await watcher.ask("info")).stable?.find(({ effect }) => effect === "spring").stiffness;
const saidStable = async () => parseFloat((await text("#effects details:first-of-type p"))
  .match(/stable up to ([\d.]+)/)?.[1]);
// Two digits of it, rounded down.
const isShown = async () => {
  const [said, border] = [await saidStable(), (await told()) ?? NaN];
  const unit = 10 ** (Math.floor(Math.log10(border)) - 1);
  return said <= border * (1 + 1e-9) && said > border - unit && Math.abs(said / unit - Math.round(said / unit)) < 1e-6;
};
const both = (stiffness) => ({ name: "Two", effect: [spring, { ...spring, id: "other", stiffness }] });
await load(both(0.1));
// Only the first is open. The other says what it is about.
await until("a folded effect", async () => (await page.locator("#effects details").evaluateAll((all) => all.map((it) => it.open).join())) === "true,false", 5);
assert.equal(await text("#effects details:nth-of-type(2) .main"), "0.1 N m/rad");
await until("the mark of the scene", isShown);
assert.match(await text("#effects details:first-of-type p"), /, the other as set$/);
const beside = await told();
await page.locator("#effects details").nth(1).evaluate((it) => (it.open = true));
const second = page.getByRole("spinbutton", { name: "other stiffness value" });
await second.fill("3");
await second.press("Enter");
await until("the other spring", async () => (await watcher.ask("info")).scene.effect[1].stiffness === 3);
await until("the mark follows the other spring", async () => (await told()) < beside - 2 && isShown());
console.log(`a second spring of 3 N m/rad moves the mark of the first from ${beside.toFixed(2)} to ${(await told()).toFixed(2)} N m/rad`);
await picture("two-springs");
await load({ name: "As text", effect: [spring] });
await watcher.mode("active");

// A scene that pulls to no orientation has no reference.
await load({ name: "Air", effect: [{ id: "air", kind: "damper", damping: 0.02 }] });
await until("no reference", () => !watcher.state.reference);
await shows("#distance", "No reference: Enable works at any orientation.");
await shows("#legend", "no reference");
await load({ name: "As text", effect: [spring] });
await shows("#distance", "rad from reference");

// The numbers of an orientation have their names, and those of many points have them once.
const heads = () => page.locator("#effects .heads").evaluateAll((all) => all.map((it) => it.textContent));
assert.deepEqual(await heads(), ["wxyz"]);
const points = [[0, 1, 0, 0, 0], [1, 1, 0.1, 0, 0]];
await load({ name: "Points", effect: [{ ...spring, kind: "track", law: undefined, path: "record", points }] });
await until("the names", async () => JSON.stringify(await heads()) === '["twxyz","wxyz"]');

// What the server would refuse is told before.
await page.click("#disable");
await watcher.mode("idle");
// Half a turn from where the sphere is, which may still turn.
const [w, x, y, z] = watcher.state.q;
await load({ name: "Far", effect: [{ ...spring, anchor: "absolute", reference: [-x, w, z, -y] }] });
await shows("#details", "Enable is refused beyond 0.50 rad");
await page.click("#stop");
await shows("#headline", "ESTOP");
await shows("#distance", "Enable works up to 0.50 rad.");
// What to do next is said once.
assert.equal((await text("body")).match(/anchor to here/g).length, 1);
await locks();
assert(await page.locator("#recover").isDisabled(), "the server would refuse");
assert.match(await page.locator("#recover").getAttribute("title"), /too far from the reference/);
await page.click("#reset");
await shows("#headline", "IDLE");
await look();
// The box says another step first.
assert.deepEqual(await next(), []);
await page.click("#enable");
await shows("#details", "Not enabled: the reference of effect \"spring\"");
await until("a refused Enable is off", () => page.locator("#enable").isDisabled());
await load({ name: "As text", effect: [spring] });
await shows("#distance", "The scene begins where the sphere is.");
assert(!(await text("#details")).includes("refused"));
await page.click("#enable");
await watcher.mode("active");
await shows("#distance", "rad from reference");

// Esc, from the key to zero torque.
await drag(0.4);
await settled();
watcher.keep = [];
await page.evaluate(() => { window.stopTick = null; });
const pressed = performance.now();
await page.keyboard.press("Escape");
await shows("#headline", "ESTOP");
await watcher.mode("estop");
const stopped = watcher.keep.find((state) => state.mode === "estop");
const arrived = await page.evaluate(() => window.stopTick);
console.log(`Esc to zero torque: ${stopped.tick - arrived} ticks after the frame arrived (wanted: 3), `
  + `${ms(stopped.came - pressed)} in all (wanted: 50)`);
assert(length(stopped.torque) === 0, "the first state of the stop has no torque");
assert(watcher.keep.filter((state) => state.tick >= stopped.tick).every((state) => state.mode === "estop"));
watcher.keep = null;
assert(watcher.state.hand, "the hand holds on until it lets go");
await page.mouse.move(middle.x - 0.5 * middle.radius, middle.y, { steps: 4 });
await page.mouse.up();
await until("the hand lets go", () => !watcher.state.hand);
await shows("#details", "Stopped by you");
await until("the box says whether the sphere still turns", async () => (
  (await text("#notice")).includes("The sphere still turns") === length(watcher.state.omega) > 0.1));
// Torque waits for a sphere that spins.
await until("Recover is the next step, or none", async () => (
  (await next()).join() === (length(watcher.state.omega) > 2 ? "" : "recover")));
await until("the sphere turns", () => length(watcher.state.omega) > 0.1);
// What the sphere does stands before what to press, and its bar is not green.
assert(await page.evaluate(() => {
  const [notice, details] = ["notice", "details"].map((id) => document.getElementById(id).getBoundingClientRect());
  return notice.height > 0 && notice.bottom <= details.top + 1;
}), "the sphere turns, and the way on comes first");
await until("no green speed without torque", () => (
  page.locator("meter[aria-label=Speed]").evaluate(({ low, value }) => value > low)));
await apart();
for (const viewport of Object.values(SHOWN)) {
  await page.setViewportSize(viewport);
  await page.waitForTimeout(300);
  assert(!await page.locator("#box.long").count(), `a stop covers the bars at ${JSON.stringify(viewport)}`);
}
await page.setViewportSize(SIZES.desk);
await picture("stopped");
await look();
await locks();
// STOP says that it has stopped, in its place, and still works.
await until("what STOP has done", async () => (
  (await text("#keys")) === (length(watcher.state.omega) > 0.1 ? "torque off, still turns" : "stopped, 0.00 N m")));
const [filled, shape] = await page.locator("#stop").evaluate((it) => [
  getComputedStyle(it).backgroundColor === getComputedStyle(it).borderTopColor, JSON.stringify(it.getBoundingClientRect())]);
assert(!filled, "STOP is outlined");
await page.evaluate(() => { window.stopTick = null; });
await page.click("#stop");
await until("STOP works after a stop", () => page.evaluate(() => window.stopTick));
// A simulated sphere turns on until a hand holds it.
await drag(0.1);
await settled();
await page.mouse.up();
await page.click("#recover");
await watcher.mode("active");
await shows("#keys", "Esc or Space stops");
assert.deepEqual(await page.locator("#stop").evaluate((it) => [
  getComputedStyle(it).backgroundColor === getComputedStyle(it).borderTopColor, JSON.stringify(it.getBoundingClientRect())]), [true, shape]);

// Space stops in a text field too, and presses no button.
await page.locator("#astext").evaluate((it) => (it.open = true));
await page.focus("#text");
await page.keyboard.press("Space");
await shows("#headline", "ESTOP");
await until("a stop at rest", async () => (await text("#keys")) === "stopped, 0.00 N m");
await picture("rest");
await page.focus("#recover");
await page.keyboard.press("Space");
await page.waitForTimeout(200);
assert.equal(watcher.state.mode, "estop", "Space is no press of a button");
await page.keyboard.press("Enter");
await watcher.mode("active");
await page.click("#stop");
await watcher.mode("estop");

// Who has stopped the rig. Nothing moves for it.
await page.click("#recover");
await watcher.mode("active");
const before = await places();
await watcher.ask("estop");
await shows("#details", "Stopped by watcher");
assert.deepEqual(await places(), before);
// Perhaps somebody else has a hand at the sphere.
await shows("#details", "make sure that nobody touches the sphere, then press Reset, then Enable.");
assert(await page.locator("#recover").isDisabled(), "one click does not lift the stop of another client");
assert.deepEqual(await next(), ["reset"]);
await page.click("#reset");
await shows("#headline", "IDLE");
await picture("idle");
await page.click("#enable");
await watcher.mode("active");

// A fault, in the words of the server. Nothing moves for them.
await load({ name: "A bad line", effect: [spring], simulate: { link: { corrupt: 0.4 } } });
await shows("#headline", "FAULT");
const words = (await watcher.ask("info")).faults.find((fault) => fault.name === watcher.state.fault);
await shows("#details", `No torque. ${words.sentence}`);
// The usual remedy is about cables, which a simulated rig does not have.
assert((await text("#details")).includes("To go on: Reset, then Enable. The rig is simulated and nothing is broken."), "what to do about a simulated fault");
assert(!(await text("#details")).includes(words.remedy), `the remedy of a real ${watcher.state.fault}`);
assert.deepEqual(await places(), before);
for (const viewport of Object.values(SIZES)) {
  await page.setViewportSize(viewport);
  await until(`the text of the fault fits at ${viewport.width} px`, () => page.evaluate(() => (
    ["box", "details"].map((id) => document.getElementById(id)).every((it) => it.scrollHeight <= it.clientHeight))), 5);
  await bars();
  await legible();
}
await page.setViewportSize(SIZES.desk);
await ticks();
await bars();
await until("the remedy of a fault begins with Reset", async () => (await next()).join() === "reset", 5);
await picture("fault");
await look();
await uncovered();
await load({ name: "A good line", effect: [spring], simulate: {} });
// A stop leaves the fault in sight.
const fault = watcher.state.fault;
await watcher.ask("estop");
await shows("#details", `Before the stop: ${fault}.`);
await shows("#details", "Stopped by watcher");
assert.equal((await text("#details")).match(/Reset, then Enable/g).length, 1, "said twice");
await picture("fault-stopped");
await uncovered();
// What is too long even there is a click away, and leaves the buttons in sight.
for (const size of ["flat", "phone"]) {
  await page.setViewportSize(SHOWN[size]);
  await page.waitForTimeout(300);
  const { width, height } = await page.locator("#more").boundingBox();
  assert(width >= 44 && height >= 32, `More: ${width} x ${height} px`);
  await page.click("#more");
  await until("the whole text", () => page.evaluate(() => {
    const [text, orders, box] = ["details", "orders", "box"].map((id) => document.getElementById(id));
    return text.scrollHeight <= text.clientHeight && orders.getBoundingClientRect().bottom <= box.getBoundingClientRect().top;
  }), 5);
  await page.screenshot({ path: `${pictures}/fault-stopped-more-${size}.png` });
  await page.click("#more");
  assert.equal(await text("#more"), "More");
}
await page.setViewportSize(SIZES.desk);
// For some ticks the cause is still there, and the server refuses.
const recovers = () => until("the rig recovers", async () => {
  for (const button of ["#recover", "#reset", "#enable"]) {
    if (await page.locator(button).isEnabled()) {
      await page.click(button);
      break;
    }
  }
  await page.waitForTimeout(200);
  return await text("#headline") === "ACTIVE";
});
await recovers();
await watcher.mode("active");

// Another client takes over, and the page takes it back after a question.
await watcher.ask("acquire", { steal: true });
await shows("#who", "you observe, watcher commands");
// What it sets is shown by the event alone, and more is asked for also if it sets without a pause.
assert.equal(await page.evaluate(async () => {
  const { Rig } = await import("/rig.js");
  const rig = new Rig("test");
  rig.info = { scene: { effect: [{ id: "spring", stiffness: 1 }] } };
  rig.event({ event: "set", effect: "spring", parameters: { stiffness: 2 } });
  return rig.info.scene.effect[0].stiffness;
}), 2);
const [{ id: changed, stiffness: usual }] = (await watcher.ask("info")).scene.effect;
const infos = await page.evaluate(() => window.infos);
for (let k = 1; k <= 20; k += 1) {
  await watcher.ask("set", { effect: changed, stiffness: usual + 0.01 * k });
  await page.waitForTimeout(100);
}
assert(await page.evaluate(() => window.infos) > infos, "nothing is asked for while another client sets");
await watcher.ask("set", { effect: changed, stiffness: usual });
await page.click("#lease");
await shows("#asked", "Take over from watcher?");
await picture("asked");
// Nothing draws through the question, wherever the page is scrolled.
await page.setViewportSize(SIZES.phone);
const sight = async () => {
  await page.waitForTimeout(300);
  const { x, y, width, height } = await page.locator("#question").boundingBox();
  const shot = await page.screenshot({ clip: { x: x + 8, y: y + 8, width: width - 16, height: height - 16 } });
  return shot.toString("base64");
};
await page.evaluate(() => window.scrollTo(0, 0));
const plain = await sight();
await page.evaluate(() => {
  const slider = document.querySelector("#effects input[type=range]").getBoundingClientRect();
  const question = document.querySelector("#question").getBoundingClientRect();
  window.scrollBy(0, slider.top - (question.top + question.bottom) / 2);
});
await until("the torque while its box is out of sight", async () => /^\d\.\d\d N m$/.test(await text("#rig")), 5);
await page.screenshot({ path: `${pictures}/asked-sliders.png` });
assert.equal(await sight(), plain, "something draws through the question");
await page.setViewportSize(SIZES.desk);
assert.equal(await page.evaluate(() => document.activeElement.id), "no", "Enter gives the safe answer");
await page.keyboard.press("Escape");
await watcher.mode("estop");
// The page must see the stop before another client ends it.
await shows("#headline", "ESTOP");
assert(await page.locator("#question").isHidden(), "Esc stops and closes the question");
await watcher.ask("reset");
await watcher.ask("enable");
await watcher.mode("active");
await shows("#headline", "ACTIVE");
await page.click("#lease");
await shows("#asked", "Take over from watcher?");
await page.click("#yes");
await shows("#who", "you command");

// A server that hangs: nothing is known, and a stop is not a stop until a state proves it.
server.kill("SIGSTOP");
await shows("#headline", "NO CONTACT");
await shows("#keys", UNHEARD);
await shows("#hint", "Last heard");
await shows("#details", "is not known. Simulated: nothing real moves.");
await shows("#details", "Last heard: ");
assert.equal(await text("#rig"), "Hbot prototype  1000 Hz");
assert.deepEqual(await page.$$eval(":is(#meters, #kept) div > span:last-child", (all) => [...new Set(all.map((it) => it.textContent))]), ["-"], "an old number");
await roomy();
await grey();
const end = () => page.evaluate(() => ["torque", "angle"].map((name) => window.written[name].filter((it) => /now|heard/.test(it))));
assert.deepEqual(await end(), [["last heard"], ["last heard"]]);
const dots = () => page.evaluate(() => {
  const { weak, axis3 } = Object.fromEntries(["weak", "axis3"].map((name) => (
    [name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim()])));
  return { [weak]: "grey", [axis3]: "coloured" }[window.dots.curves];
});
await until("grey dots", async () => (await dots()) === "grey", 5);
await locks();
await look();
// Long pictures last: the page soon makes a new connection, and has no state then.
await picture("silent");
await uncovered(roomy);
// Again, because the page soon makes a new connection to a server that is silent.
server.kill("SIGCONT");
await shows("#headline", "ACTIVE");
server.kill("SIGSTOP");
await page.keyboard.press("Escape");
await shows("#headline", "NOT STOPPED");
await shows("#details", "Simulated: nothing real moves.");
const stripes = () => page.evaluate(() => getComputedStyle(document.body).getPropertyValue("--stripe").trim()
  === getComputedStyle(document.body).getPropertyValue("--stop").trim());
// While it is known that the rig is simulated.
assert(!await stripes(), "a simulated rig is as loud as a real one");
await roomy();
await grey();
await picture("not-stopped");
await uncovered(roomy);
await look();
// No state looks like another, also for an eye that sees no colours.
assert.deepEqual(Object.keys(looks).sort(), ["ACTIVE", "ESTOP", "FAULT", "IDLE", "NO CONTACT", "NOT STOPPED"]);
assert.equal(new Set(Object.values(looks)).size, 6, JSON.stringify(looks, null, 1));
server.kill("SIGCONT");
await shows("#rig", "Hz");
// The server may have read the stop when it went on. One that found no server is lost, and asked for again.
const proved = () => until("a stop that is proved", async () => {
  const head = await text("#headline");
  if (head === "NOT STOPPED") await page.keyboard.press("Escape");
  return head === "ESTOP";
});
await proved();
await until("the plots end now", async () => JSON.stringify(await end()) === '[["now"],["now"]]');
await until("the dots have their colours", async () => (await dots()) === "coloured");

// A server that is gone, and comes back.
const { ports } = server;
await server.end();
await shows("#headline", "NO CONTACT");
await shows("#details", "Not connected");
assert.equal(await text("#badge"), "was SIMULATED", "what it was");
assert.equal(await page.locator("#badge").getAttribute("data-kind"), "unknown", "the next server there may have a real rig");
await shows("#absent", `No server answers at ${ports.web}.`);
const [under, over] = await page.evaluate(() => [document.querySelector("#keys").getBoundingClientRect().bottom,
  document.querySelector("#orders").getBoundingClientRect().top]);
assert(under <= over, `the line below STOP ends at ${under} px, and the buttons begin at ${over} px`);
await page.setViewportSize({ width: 360, height: 640 });
const inRow = () => until("badge, chip and button in one row", () => page.evaluate(() => {
  const [button, ...rest] = ["lease", "badge", "chip"].map((id) => document.getElementById(id).getBoundingClientRect());
  return rest.every((it) => it.top >= button.top && it.bottom <= button.bottom);
}), 5);
await inRow();
await page.setViewportSize(SIZES.desk);
await picture("gone");
await uncovered(roomy);
server = await Server.start(hbot, ports);
await shows("#headline", "ACTIVE");
await shows("#who", "nobody commands");

// How a real rig looks: the same server, which says that its rig is real.
await page.addInitScript(() => {
  const parse = JSON.parse;
  // When `shakes` changes, also that the sphere shakes, and it turns at 13 rad/s. With `hides`, nothing of the scene's
  // curve. With `cuts`, the limits cut 64 % of the torque. With `deaf`, no state comes. With
  // `turned`, an angle about n3, rad. With `step`, another reference. With `strains`, a torque of
  // 0.89 of 0.90 N m. With `fast`, a damaged line is a sphere that is too fast. With `spins`, it
  // turns at so many rad/s. With `begins`, the start is not over.
  const shaking = { event: "shaking", frequency: 10, amplitude: 13, effect: "spring", gain: 0.5, message: "the sphere shakes" };
  let told = false;
  JSON.parse = (text) => {
    if (text.includes('"event":"state"') && told !== Boolean(window.shakes)) {
      told = window.shakes;
      return { ...shaking, shaking: told };
    }
    if (window.deaf && text.includes('"event":"state"')) return {};
    // What the sphere really does is not told while it is said to shake.
    if (window.shakes && text.includes('"event":"shaking"')) return {};
    return parse(text.replace('"simulated":true', '"simulated":false')
      .replace(/"omega":\[[^\]]*\]/, (told) => (window.shakes ? '"omega":[0,13,0]' : told))
      .replace(/"omega":\[[^\]]*\]/, (told) => (window.spins ? `"omega":[0,${window.spins},0]` : told))
      .replace('"mode":"active"', (told) => (window.begins ? '"mode":"enabling"' : told))
      .replace(/"scale":[^,}]*/, (told) => (window.cuts ? '"scale":0.36' : told))
      .replace(/"traction":[^,}]*/, (told) => (window.slides ? '"traction":1' : told))
      .replace(/"q":\[[^\]]*\]/, (told) => (window.turned
        ? `"q":[${Math.cos(window.turned / 2)},0,0,${Math.sin(window.turned / 2)}]` : told))
      .replace(/"reference":\[[^\]]*\]/, (told) => (window.step ? '"reference":[0.9,0.435889894,0,0]' : told))
      .replace(/"torque":\[[^\]]*\]/, (told) => (window.strains ? '"torque":[0,0.89,0]' : told))
      .replace('"curves":', (told) => (window.hides ? '"hidden":' : told))
      .replace(/"fault":"link_corrupt"|"omega":\[[^\]]*\]/g, (told) => (!window.fast ? told
        : { f: '"fault":"overspeed"', o: '"omega":[0,31,0]' }[told[1]])));
  };
});
await page.reload();
await shows("#badge", "LIVE");
await page.click("#lease");
await shows("#who", "you command");
await shows("#hint", "Drag to turn the view");
await page.waitForTimeout(1500);
assert.match(await page.locator("header").evaluate((it) => getComputedStyle(it).boxShadow), /^rgb\(255, 196, 0\) 0px -4px 0px 0px inset$/,
  "the line of a real rig");

// A line breaks where time has a gap, the angle wraps or the reference steps, and nowhere else.
const parts = () => page.evaluate(() => [window.parts.torque, window.parts.angle]);
await page.waitForTimeout(500);
assert.deepEqual(await parts(), [1, 1]);
await page.evaluate(() => { window.deaf = true; });
await page.waitForTimeout(900);
await page.evaluate(() => { window.deaf = false; });
await until("a gap", async () => JSON.stringify(await parts()) === "[2,2]", 5);
await page.evaluate(() => { window.turned = 3; });
await page.waitForTimeout(200);
const [, turning] = await parts();
await page.evaluate(() => { window.turned = -3; });
await until("a wrap", async () => (await parts())[1] === turning + 1, 5);
await page.evaluate(() => { window.turned = null; });
await page.waitForTimeout(200);
const [, turnedBack] = await parts();
await page.evaluate(() => { window.step = true; });
await until("a step of the reference", async () => JSON.stringify(await parts()) === JSON.stringify([2, turnedBack + 1]), 5);
await page.evaluate(() => { window.step = false; });
// Until they have left the plots.
await until("lines in one part", async () => JSON.stringify(await parts()) === "[1,1]");
await picture("live");
// STOP says that it is no emergency stop.
assert.equal(await text("#keys"), "Esc or Space stops. Not an emergency switch.");
await page.setViewportSize(SIZES.phone);
await until("short words on a telephone", async () => (await text("#keys")) === "Not an emergency switch");
await page.setViewportSize(SIZES.desk);
await page.evaluate(() => { window.begins = true; });
await shows("#headline", "ENABLING");
// Each state has a sign of its own, and a beginning torque another edge than a full one.
const [signs, edges] = await page.evaluate(() => {
  const { head } = document.body.dataset;
  const all = ["idle", "unreferenced", "enabling", "active", "estop", "fault", "no-contact", "not-stopped"].map((name) => {
    document.body.dataset.head = name;
    const { clipPath, borderTopStyle } = getComputedStyle(document.getElementById("headline"), "::before");
    return [`${clipPath} ${borderTopStyle}`, getComputedStyle(document.getElementById("box")).borderTopStyle];
  });
  document.body.dataset.head = head;
  return [0, 1].map((k) => all.map((it) => it[k]));
});
assert.equal(new Set(signs).size, signs.length, JSON.stringify(signs));
assert.notEqual(edges[2], edges[3], "enabling has the edge of active");
await picture("enabling");
await page.evaluate(() => { window.begins = false; });
await shows("#headline", "ACTIVE");

// The scene's curve follows a stiffness before the server has told the new one.
const range = (most) => until(`a curve up to ${most} N m`, () => page.evaluate((it) => window.written.curves.includes(it), most));
await range("2");
await page.evaluate(() => { window.hides = true; });
await number.fill("0.1");
await number.press("Enter");
// The scale holds until it is clicked.
await page.waitForTimeout(300);
await range("2");
await page.click("#curves");
await range("0.5");
await page.click("#curves");
await range("2");
await page.evaluate(() => { window.hides = false; });

// What the limits cut has the colour of the torque, and not that of a warning.
await page.evaluate(() => { window.cuts = true; });
await shows("#notice", "Limits cut 64 % of the torque");
await page.evaluate(() => { window.slides = true; });
await shows("#notice", "Friction cuts 64 % of the torque");
await page.evaluate(() => { window.slides = false; });
await shows("#notice", "Limits cut 64 % of the torque");
const [cut, torque] = await page.evaluate(() => {
  const probe = Object.assign(document.createElement("i"), { style: "color: var(--torque)" });
  document.body.append(probe);
  return [document.querySelector("#notice .cut"), probe].map((it) => getComputedStyle(it).color);
});
assert.equal(cut, torque);
/** Checks that the box and the chip say that the torque is at its limits, and what to do. */
async function strained(word) {
  await until("a chip", async () => await page.locator("#chip").textContent() === `ACTIVE: ${word}`, 5);
  await shows("#details", "Lower stiffness, or push less.", 5);
  // The colour of the box changes within 0.1 s.
  await until("the colour of the torque", () => page.evaluate((torque) => ["box", "chip"].every((id) => (
    getComputedStyle(document.getElementById(id)).borderTopColor === torque)), torque), 5);
}
await strained("reduced");
await short("Lower stiffness", "Limits cut 64 %");
await picture("cut");
await page.evaluate(() => { [window.cuts, window.strains] = [false, true]; });
await shows("#notice", "The torque is at the rig's limit");
await strained("at limit");
await page.evaluate(() => { [window.cuts, window.strains] = [true, false]; });
await shows("#notice", "Limits cut 64 % of the torque");
// Beside a warning too, and at every size. It is of what a simulated rig keeps of an earlier scene.
await load({ name: "A fair line", effect: [spring], simulate: { hand: {}, link: { loss: 0.001 } } });
await page.selectOption("#shelf", "spring");
await page.click("#load");
await shows("#warnings", 'keeps that of the scene "A fair line": link, hand. A table with');
await shows("#notice", "Limits cut 64 % of the torque. Warning: simulate: ");
for (const viewport of [...Object.values(SIZES), { width: 360, height: 640 }, { width: 844, height: 390 }]) {
  await page.setViewportSize(viewport);
  await insight("Limits cut 64 %", "Warning: simulate");
}
await page.setViewportSize(SIZES.desk);
await short("Lower stiffness", "Limits cut 64 %", "Warning: simulate");
// A long warning is folded to two lines.
const tallness = () => page.locator("#warnings li > span").evaluate((it) => it.clientHeight / parseFloat(getComputedStyle(it).lineHeight));
assert(await tallness() < 2.5, "a long warning");
await page.click("#warnings button");
assert(await tallness() > 2.5, "the whole warning");
await page.click("#warnings button");
// A notice that ends in dots has More, and then all its words.
const dotted = () => page.locator("#notice").evaluate((it) => it.scrollHeight > it.clientHeight + 1 || it.scrollWidth > it.clientWidth);
let dottedAt = 0;
for (const [width, height] of [[1280, 800], [1024, 600], [390, 844], [360, 640], [844, 390], [640, 360]]) {
  await page.setViewportSize({ width, height });
  await page.waitForTimeout(300);
  assert.equal(await page.locator("#more").isVisible(), await dotted(), `More at ${width} x ${height}`);
  if (!await dotted()) continue;
  dottedAt += 1;
  await page.click("#more");
  await until(`the whole notice at ${width} x ${height}`, async () => !await dotted(), 5);
  assert.equal(await text("#more"), "Less");
  await page.screenshot({ path: `${pictures}/cut-warned-more-${width}.png` });
  await page.click("#more");
  await until(`the notice is short again at ${width} x ${height}`, dotted, 5);
}
assert(dottedAt > 0, "no size at which the notice is cut");
await page.setViewportSize(SIZES.desk);
await picture("cut-warned");
await load({ name: "A good line", effect: [spring], simulate: {} });
await page.evaluate(() => { window.cuts = false; });

// A sphere that spins after a stop gets no torque yet.
await until("rest", async () => /^0\.00 .*rad/m.test(await text("#meters")));
await page.keyboard.press("Escape");
await until("a stop at rest", async () => (await text("#keys")) === "stopped, 0.00 N m");
assert.deepEqual(await next(), ["recover"]);
await page.evaluate(() => { window.spins = 3; });
await until("why Recover waits", async () => (await text("#distance")) === "Recover when the sphere rests");
assert.equal(await text("#keys"), "torque off, still turns");
assert(await page.locator("#recover").isDisabled(), "torque for a sphere that spins");
await shows("#details", "wait until the sphere rests, then press Recover.");
assert.deepEqual(await next(), []);
await locks();
await picture("spins");
await page.evaluate(() => { window.spins = false; });
await page.click("#recover");
await shows("#headline", "ACTIVE");

// A scene that is warned of is an alarm while it shakes.
const alarm = () => page.evaluate(() => document.body.classList.contains("shakes"));
await number.fill("200");
await number.press("Enter");
await shows("#warnings", "spring: may shake");
assert(!await alarm(), "at rest");
await until("a word for amber", async () => await page.locator("#chip").textContent() === "ACTIVE: warning");
await page.evaluate(() => { window.shakes = window.cuts = true; });
await shows("#details", "spring shook the sphere at 10 Hz.");
assert(await alarm());
// The figure is that of the sentence.
assert.match(await text("#now"), /^10\s*Hz\s*shaking frequency$/);
const cures = await Promise.all([text("#details p:first-child"), text("#warnings strong")]);
assert.match(cures[0], /^Set stiffness = /, "what to do comes first");
assert.equal(cures[0], cures[1], "two instructions");
// With 13 of 30 rad/s.
await until("the speed of a sphere that shakes is not green", () => (
  page.locator("meter[aria-label=Speed]").evaluate(({ low, value }) => value > low)));
for (const [width, height] of [[1280, 800], [1024, 600], [390, 844], [360, 640], [844, 390], [640, 360]]) {
  await page.setViewportSize({ width, height });
  // The alarm begins anew, and is not only fitted because the window has changed.
  await page.evaluate(() => { window.shakes = false; });
  await until("calm", async () => !await alarm());
  await page.evaluate(() => { window.shakes = true; });
  await until("the alarm", alarm);
  await page.waitForTimeout(300);
  assert(!await page.locator("#box.long").count(), `the alarm covers the bars at ${width} x ${height}`);
  await insight("Set stiffness", "Limits cut 64 %", "Torque lowered");
  // A colour never stands alone.
  assert.equal(await page.locator("#chip").textContent(), "ACTIVE: shakes");
  if (width < 600) await inRow();
}
await page.setViewportSize(SIZES.desk);
// Louder than a fault.
for (const [colorScheme, loud] of [["dark", "rgb(245, 176, 33)"], ["light", "rgb(143, 90, 0)"]]) {
  await page.emulateMedia({ colorScheme });
  assert.equal(await page.locator("#box").evaluate((it) => getComputedStyle(it).backgroundColor), loud);
}
await picture("shakes");
await page.evaluate(() => { window.shakes = window.cuts = false; });
await until("calm", async () => !await alarm());

// A fault of a real rig has the usual remedy, and a sphere that is too fast has one speed.
await page.evaluate(() => { window.fast = true; });
await load({ name: "A bad line", effect: [spring], simulate: { link: { corrupt: 0.4 } } });
await shows("#details", "The sphere must slow down before Reset: 31.00 rad/s");
assert(!(await text("#box")).includes("still turns"), "two speeds");
await page.evaluate(() => { window.fast = false; });
await shows("#details", "To go on: Reset, then Enable.");
// Reset is the next step once the sphere rests, and works before.
const leads = (what, id) => until(what, async () => (await next()).join() === id, 5);
await leads("Reset at rest", "reset");
await page.evaluate(() => { window.spins = 1; });
await leads("no next step while the sphere turns", "");
assert(await page.locator("#reset").isEnabled(), "the server resets it");
await page.evaluate(() => { window.spins = false; });
await leads("Reset at rest again", "reset");

// Without an answer of a real rig, its power is what counts.
await load({ name: "A good line", effect: [spring], simulate: {} });
await recovers();
server.kill("SIGSTOP");
await shows("#details", "If in doubt, cut the motors' power.");
assert.match(await text("#details .strong"), /^If in doubt/);
server.kill("SIGCONT");
await shows("#headline", "ACTIVE");
const said = await spoken();
server.kill("SIGSTOP");
await page.keyboard.press("Escape");
await shows("#details", "STOP sent, not confirmed yet.");
await shows("#headline", "NOT STOPPED");
await shows("#details", "Cut the motors' power.");
assert.equal(await page.locator("#alarm").textContent(), "NOT STOPPED: cut the motors' power");
const lines = await said.jsonValue();
const sent = lines.indexOf("STOP sent, not confirmed yet");
assert(sent >= 0 && lines[sent + 1] === UNHEARD, lines.join("\n"));
await roomy();
const orders = await page.$$eval("#details p", (all) => all.slice(0, 2).map((it) => [it.textContent.split(",")[0], getComputedStyle(it).fontSize]));
assert.deepEqual([orders[0], orders[1][0]], [["Cut the motors' power.", "26px"], "Last heard: ACTIVE"]);
await picture("not-stopped-live");
await uncovered(roomy);
assert(await stripes(), "the stripes of a real rig");
server.kill("SIGCONT");
await proved();
await shows("#keys", "stopped, 0.00 N m");
server.kill("SIGSTOP");
await shows("#headline", "NO CONTACT");
await picture("silent-live");
server.kill("SIGCONT");

// A stop that is lost with its server, and the next server pushes: its states are no old ones.
const last = server.ports;
await server.end();
await shows("#headline", "NO CONTACT");
await page.keyboard.press("Escape");
await shows("#headline", "NOT STOPPED");
server = await Server.start(hbot, last);
await shows("#details", "Connected again: the rig is ACTIVE and pushes. Press STOP.");
await shows("#keys", "Connected again: STOP reaches the rig");
// One thing after the other: STOP works again.
assert.match(await text("#details"), /^Connected again: .* Press STOP\.\s*If it pushes on, cut the motors' power\./);
assert.equal(await text("#notice"), "");
assert(!await page.locator("#lease.next").count(), "another next step than the box says");
assert(!await page.evaluate(() => document.body.classList.contains("old")), "grey");
await bars();
await picture("pushes-again");
await page.keyboard.press("Escape");
await shows("#headline", "ESTOP");

// A server in virtual time that waits for a client sends no states. The connection stays.
const slow = await Server.start(hbot, undefined, ["--time", "virtual"]);
const driver = await Client.connect(slow.listen, "driver");
await driver.ask("acquire");
await driver.ask("advance", { ticks: 10 });
const waits = await context.newPage();
let connections = 0;
waits.on("websocket", () => (connections += 1));
await fresh(waits);
await waits.goto(slow.page);
await waits.waitForTimeout(6000);
assert.equal(connections, 1, "a server that waits is taken for one that is gone");
await waits.close();
driver.end();
await slow.end();

// A finger has no keys.
const tablet = await browser.newContext({ viewport: { width: 820, height: 1100 }, hasTouch: true, isMobile: true });
const finger = await tablet.newPage();
await fresh(finger);
await finger.goto(server.page);
const acts = [() => {}, () => finger.click("#lease"), () => finger.click("#stop")];
for (const act of acts) {
  await act();
  await finger.waitForTimeout(500);
  // Two pages have one name.
  if (act !== acts[0]) assert.match(await text("#who"), /^you observe, Chrome on Linux \(session \d+\) commands$/);
  const words = await finger.evaluate(() => document.body.textContent);
  assert(!/\b(Esc|Space|[Kk]eys|[Ss]croll|double click)\b/.test(words), words);
}
await finger.screenshot({ path: `${pictures}/finger.png` });
// Other devices have other names.
for (const [name, userAgent] of [
  ["Firefox on Android", "Mozilla/5.0 (Android 14; Mobile; rv:140.0) Gecko/140.0 Firefox/140.0"],
  ["Safari on iPad", "Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) AppleWebKit/605.1.15 (KHTML, like Gecko) Version/18.5 Safari/605.1.15"],
  ["Edge on Windows", "Mozilla/5.0 (Windows NT 10.0; Win64; x64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/156.0.0.0 Safari/537.36 Edg/156.0.0.0"],
]) {
  const device = await browser.newContext({ userAgent, hasTouch: !name.includes("Windows") });
  const there = await device.newPage();
  await fresh(there);
  await there.goto(server.page);
  await there.click("#lease");
  await shows("#who", `you observe, ${name} commands`);
  await device.close();
}

// The browser complains of lost connections, which are meant here, and of nothing else.
assert.deepEqual(complaints.filter((text) => !/WebSocket connection to|ERR_CONNECTION/.test(text)), []);
await browser.close();
watcher.end();
await server.end();
