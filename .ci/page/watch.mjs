// Runs in the page before its own code, and measures it from outside.

export function watch() {
  let states = 0;
  window.stopTick = null;
  window.infos = 0;
  const Plain = window.WebSocket;
  window.WebSocket = class extends Plain {
    constructor(...all) {
      super(...all);
      this.addEventListener("message", ({ data }) => {
        if (data.startsWith('{"event":"state"')) states += 1;
        else if (data.includes('"before the stop"')) window.stopTick ??= JSON.parse(data).ok.tick;
      });
    }

    send(data) {
      // The tick at which the server reads the frame of a stop.
      if (String(data).includes('"estop"')) super.send('{"id":"before the stop","op":"ping"}');
      if (String(data).includes('"info"')) window.infos += 1;
      super.send(window.spoils ? data.replace('"q":[', '"q":[9,') : data);
    }
  };

  /** Calls `act` with each tick whose picture has been painted, and with the time, ms since 1970. */
  function painted(act) {
    const channel = new MessageChannel();
    let tick = null;
    channel.port1.onmessage = () => act(+tick, performance.timeOrigin + performance.now());
    const observer = new MutationObserver(() => {
      tick = document.querySelector("#sphere").dataset.tick;
      // Within the frame's callback. The next task comes after the frame was painted.
      if (tick) channel.port2.postMessage(0);
    });
    observer.observe(document.querySelector("#sphere"), { attributes: true, attributeFilter: ["data-tick"] });
    return () => observer.disconnect();
  }

  document.addEventListener("DOMContentLoaded", () => {
    const end = painted(() => {
      window.firstTick = performance.now();
      end();
    });
  });

  // What is written on each canvas since it was cleared, and what of it ends beyond the right edge.
  window.written = {};
  window.beyond = {};
  // Where each text stands, px.
  window.rectangles = {};
  // The colour of the newest dot on each canvas.
  window.dots = {};
  // The most parts that a line on each canvas has, and how many the present one has.
  window.parts = {};
  let parts = 0;
  const { arc, beginPath, clearRect, fillText, moveTo } = CanvasRenderingContext2D.prototype;
  Object.assign(CanvasRenderingContext2D.prototype, {
    arc(...all) {
      window.dots[this.canvas.id] = this.fillStyle;
      arc.apply(this, all);
    },
    beginPath(...all) {
      parts = 0;
      beginPath.apply(this, all);
    },
    moveTo(...all) {
      parts += 1;
      window.parts[this.canvas.id] = Math.max(parts, window.parts[this.canvas.id]);
      moveTo.apply(this, all);
    },
    clearRect(...all) {
      window.written[this.canvas.id] = [];
      window.rectangles[this.canvas.id] = [];
      window.parts[this.canvas.id] = 0;
      delete window.beyond[this.canvas.id];
      clearRect.apply(this, all);
    },
    fillText(text, ...at) {
      window.written[this.canvas.id].push(text);
      // The pictures of the sphere have them in the middle.
      const half = this.measureText(text).width / 2;
      window.rectangles[this.canvas.id].push({ text, left: at[0] - half, right: at[0] + half, top: at[1] - 6, bottom: at[1] + 6 });
      const end = this.textAlign === "left" ? at[0] + this.measureText(text).width : 0;
      if (end > this.canvas.clientWidth) (window.beyond[this.canvas.id] ??= []).push(text);
      fillText.call(this, text, ...at);
    },
  });

  const later = (time) => new Promise((resolve) => setTimeout(resolve, time));

  /** Returns for `time` ms the tick of each picture and when it was painted, and how many states came. */
  window.measure = async (time) => {
    const [pictures, before] = [[], states];
    const end = painted((tick, now) => pictures.push([tick, now]));
    await later(time);
    end();
    return { pictures, states: states - before };
  };

  /** Keeps the page busy for `time` ms. The ticks of the pictures in the second after it are in `window.late`. */
  window.block = (time) => {
    const busy = performance.now() + time;
    while (performance.now() < busy);
    window.late = [];
    later(1000).then(painted((tick) => window.late.push(tick)));
  };
}
