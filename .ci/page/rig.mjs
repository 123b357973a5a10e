// A server on a simulated rig, and a client of its TCP port, for the checks of the page.
import { spawn } from "node:child_process";
import net from "node:net";

/** Waits until `test` returns something true, for at most `seconds`. Returns it. */
export async function until(what, test, seconds = 30) {
  const end = Date.now() + 1000 * seconds;
  for (;;) {
    const found = await test();
    if (found) return found;
    if (Date.now() > end) throw new Error(`not within ${seconds} s: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

export class Server {
  /** Starts a server. The ports are those of an earlier one, or free ones. `more` are further options. */
  static async start(hbot, ports = { listen: "127.0.0.1:0", web: "127.0.0.1:0" }, more = []) {
    const server = new Server();
    server.process = spawn(hbot, ["server", "--port", "sim", "--listen", ports.listen, "--web", ports.web, ...more], {
      stdio: ["ignore", "pipe", "ignore"],
    });
    // Also if a check fails, and while the server is held.
    process.on("exit", () => server.kill());
    let text = "";
    server.process.stdout.on("data", (data) => (text += data));
    await until("the server listens", () => /^ *listen/m.test(text) && /^ *web/m.test(text));
    server.listen = text.match(/^ *listen +(\S+)$/m)[1];
    server.page = text.match(/^ *web +(http:\S+)/m)[1];
    return server;
  }

  get ports() {
    return { listen: this.listen, web: new URL(this.page).host };
  }

  kill(signal = "SIGKILL") {
    this.process.kill(signal);
  }

  async end() {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    this.kill("SIGTERM");
    await ended;
  }
}

/** A client of the TCP port. `state` is the newest state, and `states` all of them if they are kept. */
export class Client {
  static async connect(address, name, every = 1) {
    const client = new Client();
    const [host, port] = address.split(":");
    client.socket = net.connect(+port, host);
    client.socket.setNoDelay(true);
    client.socket.on("error", () => {});
    client.waiting = new Map();
    client.keep = null;
    client.faults = [];
    client.id = 0;
    let text = "";
    client.socket.on("data", (data) => {
      const lines = (text + data).split("\n");
      text = lines.pop();
      lines.forEach((line) => client.take(JSON.parse(line)));
    });
    await client.ask("hello", { version: 1, name });
    await client.ask("subscribe", { every });
    await until("a state", () => client.state);
    return client;
  }

  take(message) {
    if (message.event === "state") {
      this.state = message;
      message.came = performance.now();
      this.keep?.push(message);
    } else if (message.event === "fault") this.faults.push(message);
    else if (message.id !== undefined) {
      this.waiting.get(message.id)?.(message);
      this.waiting.delete(message.id);
    }
  }

  async ask(op, fields = {}) {
    const id = ++this.id;
    const answer = new Promise((resolve) => this.waiting.set(id, resolve));
    this.socket.write(`${JSON.stringify({ id, op, ...fields })}\n`);
    const { ok, error } = await answer;
    if (error) throw new Error(`${op}: ${error.message}`);
    return ok;
  }

  mode(...modes) {
    return until(`the mode ${modes}`, () => modes.includes(this.state.mode));
  }

  end() {
    this.socket.destroy();
  }
}

export const length = (v) => Math.hypot(...v);

/** The angle of the least rotation from one orientation to another, rad. */
export function angle(p, q) {
  const dot = Math.abs(p.reduce((sum, x, k) => sum + x * q[k], 0));
  return 2 * Math.acos(Math.min(1, dot));
}

/** Returns the value below which `part` of the values are. */
export function quantile(values, part) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))];
}
