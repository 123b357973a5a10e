// Runs in the page before its own code, and measures it from outside.

export function watch() {
  /** The time of tick 0, ms since 1970, from the answer to `info`. */
  let origin = null;
  let states = 0;
  window.stopTick = null;
  const Plain = window.WebSocket;
  window.WebSocket = class extends Plain {
    constructor(...all) {
      super(...all);
      this.addEventListener("message", ({ data }) => {
        const message = JSON.parse(data);
        if (message.event === "state") states += 1;
        if (message.ok?.clock) origin = message.ok.clock.unix_ns / 1e6;
        if (message.id === "before the stop") window.stopTick ??= message.ok.tick;
      });
    }

    send(data) {
      // The tick at which the server reads the frame of a stop.
      if (String(data).includes('"estop"')) super.send('{"id":"before the stop","op":"ping"}');
      super.send(data);
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

  const later = (time) => new Promise((resolve) => setTimeout(resolve, time));

  /** Measures for `time` ms how old each state is when its picture has been painted, ms. */
  window.measure = async (time) => {
    const [ages, before] = [[], states];
    const end = painted((tick, now) => origin && ages.push(now - origin - tick));
    await later(time);
    end();
    return { ages, states: states - before, pictures: ages.length };
  };

  /** Keeps the page busy for `time` ms. Returns how many states from this time are drawn later. */
  window.block = async (time) => {
    const busy = performance.now() + time;
    while (performance.now() < busy);
    const until = performance.timeOrigin + performance.now() - origin;
    let drawn = 0;
    const end = painted((tick) => (drawn += tick < until - 50 ? 1 : 0));
    await later(1000);
    end();
    return { drawn };
  };
}
