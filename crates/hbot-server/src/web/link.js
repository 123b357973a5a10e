// The connection to the server: one WebSocket, whose text frames are the lines of docs/api.md.

/** Pauses between attempts to connect, ms: the first, and the longest. */
const PAUSE = [250, 2000];
/** A connection that has not opened after this time is given up, ms. */
const OPEN_WITHIN = 4000;
/** A request that is not answered after this time has failed, ms. */
const ANSWER_WITHIN = 5000;

/** A request that the server has refused, with the field `code` of its answer. */
export class Refused extends Error {
  constructor(body) {
    // The op is for programs.
    super(body.message.replace(/^op \w+: /, ''));
    this.code = body.code;
  }
}

/**
 * Keeps a connection, and makes a new one when it is lost. `on` has the functions
 * `opened(hello)`, `closed({ why, code })`, `event(message)`, `refused(error)` of a request without a
 * number, and `token()`, which returns the token or null.
 */
export class Link {
  constructor(url, name, on) {
    Object.assign(this, { url, name, on, socket: null, hello: null, pause: PAUSE[0], id: 0, nextAt: 0, heard: 0 });
    this.waiting = new Map();
    this.connect();
  }

  get isOpen() {
    return this.hello !== null && this.socket.readyState === WebSocket.OPEN;
  }

  connect() {
    clearTimeout(this.again);
    const socket = new WebSocket(this.url);
    this.socket = socket;
    this.hello = null;
    const late = setTimeout(() => this.lost(socket, 'the server does not answer'), OPEN_WITHIN);
    socket.onopen = () => {
      this.request('hello', { version: 1, name: this.name, token: this.on.token() ?? undefined })
        .then((hello) => {
          clearTimeout(late);
          this.hello = hello;
          this.pause = PAUSE[0];
          this.on.opened(hello);
        })
        .catch((error) => this.lost(socket, error.message, error.code));
    };
    socket.onmessage = ({ data }) => this.take(JSON.parse(data));
    socket.onclose = () => {
      clearTimeout(late);
      this.lost(socket, this.hello ? 'the connection has ended' : 'nobody answers there');
    };
  }

  /** Gives a connection up and plans the next attempt. */
  lost(socket, why, code) {
    if (socket !== this.socket) return;
    this.socket = null;
    this.hello = null;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
    for (const { reject, timer } of this.waiting.values()) {
      clearTimeout(timer);
      reject(new Error(why));
    }
    this.waiting.clear();
    const wait = this.pause;
    this.pause = Math.min(2 * wait, PAUSE[1]);
    this.nextAt = performance.now() + wait;
    this.on.closed({ why, code });
    // Without a token, a further attempt would fail in the same way.
    if (code !== 'unauthorized') this.again = setTimeout(() => this.connect(), wait);
  }

  /** Makes a new connection in place of one over which nothing comes any more. */
  renew(why) {
    if (this.socket) this.lost(this.socket, why);
  }

  take(message) {
    this.heard = performance.now();
    if (message.event !== undefined) {
      this.on.event(message);
      return;
    }
    // The server could not read the number of this request, for example because it is too long.
    if (message.error && message.id === null) this.on.refused(message.error);
    const asked = this.waiting.get(message.id);
    if (!asked) return;
    this.waiting.delete(message.id);
    clearTimeout(asked.timer);
    if (message.error) asked.reject(new Refused(message.error));
    else asked.resolve(message.ok);
  }

  /** Sends a request. The promise has what `ok` holds, or fails with why there is no answer. */
  request(op, fields = {}) {
    return new Promise((resolve, reject) => {
      if (this.socket?.readyState !== WebSocket.OPEN) {
        reject(new Error('there is no connection to a server'));
        return;
      }
      const id = ++this.id;
      const timer = setTimeout(() => {
        this.waiting.delete(id);
        reject(new Error('the server has not answered'));
      }, ANSWER_WITHIN);
      this.waiting.set(id, { resolve, reject, timer });
      this.socket.send(JSON.stringify({ id, op, ...fields }));
    });
  }

  /**
   * Asks for a stop over a connection that is made for it. This is for a moment in which nothing
   * comes over the usual one. `opened` gets the number of the new connection.
   */
  stopApart(opened) {
    return new Promise((resolve, reject) => {
      const socket = new WebSocket(this.url);
      const end = (act, value) => {
        clearTimeout(timer);
        socket.onclose = null;
        socket.close();
        act(value);
      };
      const timer = setTimeout(() => end(reject, new Error('the server does not answer')), 1000);
      const token = this.on.token() ?? undefined;
      // Both at once: the stop does not wait for the answer to hello.
      socket.onopen = () => {
        socket.send(JSON.stringify({ id: 1, op: 'hello', version: 1, name: this.name, token }));
        socket.send(JSON.stringify({ id: 2, op: 'estop' }));
      };
      socket.onclose = () => end(reject, new Error('nobody answers there'));
      socket.onmessage = ({ data }) => {
        const message = JSON.parse(data);
        if (message.error) end(reject, new Refused(message.error));
        else if (message.id === 1) opened(message.ok.session);
        else if (message.id === 2) end(resolve, message.ok);
      };
    });
  }
}
