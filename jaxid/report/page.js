(() => {
  // Charts: zoom and pan over the common axis, by buttons, keys, the pointer and two fingers. The page works without.
  const X = 100000, Y = 10000;
  const ticks = (low, high, most) => {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 2.5, 5, 10].map(t => t * power).find(t => t >= rough * (1 - 1e-9));
    const first = Math.floor(Math.log10(step) + 1e-9), quarter = Math.abs(step / 10 ** first - 2.5) < 0.01 ? 1 : 0;
    const digits = Math.max(0, -first + quarter), found = [];
    const largest = Math.max(Math.abs(low), Math.abs(high)), short = step >= 1e-4 && largest < 1e6;
    const significant = Math.min(Math.ceil(Math.log10(largest / step)) + 2, 15);
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
      const x = k * step, text = short ? x.toFixed(digits) : Number(x.toPrecision(significant)).toString();
      found.push([k === 0 ? "0" : text.replaceAll("-", "\u2212"), x]);
    }
    return found.length < 2 && most < 20 ? ticks(low, high, most + 1) : found;  // one label alone tells no scale
  };
  const points = path => {
    // Decodes a path of jaxid/report/chart.py: absolute starts, relative steps.
    const xs = [], ys = [];
    let x = 0, y = 0;
    for (const [, letter, rest] of path.getAttribute("d").matchAll(/([MmlhvHVz])([^MmlhvHVz]*)/g)) {
      const n = (rest.match(/-?\d+/g) || []).map(Number);
      if (letter === "M") { [x, y] = n; xs.push(x); ys.push(y); }
      if (letter === "m") { x += n[0]; y += n[1]; xs.push(x); ys.push(y); }
      if (letter === "h") { x += n[0]; xs.push(x); ys.push(y); }
      if (letter === "v") { y += n[0]; xs.push(x); ys.push(y); }
      if (letter === "l") for (let k = 0; k < n.length; k += 2) { x += n[k]; y += n[k + 1]; xs.push(x); ys.push(y); }
    }
    return [xs, ys];
  };
  const setUp = chart => {
    if (chart.dataset.ready) return;
    chart.dataset.ready = "1";
    const start = +chart.dataset.start, stop = +chart.dataset.stop, panels = [...chart.querySelectorAll(".panel")];
    const plots = panels.map(p => p.querySelector(".plot")), axis = chart.querySelector(".axis");
    const said = chart.querySelector(".shown"), cache = new Map();
    let from = 0, to = X;
    const spread = (box, found, side) => {
      box.querySelectorAll(".tick").forEach(t => t.remove());
      for (const [text, at] of found) {
        const tick = document.createElement("span");
        tick.className = "tick"; tick.textContent = text; tick.style[side] = at.toFixed(3) + "%";
        box.append(tick);
      }
    };
    const heights = plot => {
      let low = Infinity, high = -Infinity;
      for (const path of plot.querySelectorAll("path.trace")) {
        if (!cache.has(path)) cache.set(path, points(path));
        const [xs, ys] = cache.get(path);
        for (let k = 0; k < xs.length; k++) if (xs[k] >= from && xs[k] <= to) {
          low = Math.min(low, ys[k]); high = Math.max(high, ys[k]);
        }
      }
      low = Math.max(low, 0); high = Math.min(high, Y);
      if (!(high > low)) return [0, Y];
      const margin = 0.06 * (high - low);
      return [low - margin, high + margin];
    };
    const draw = () => {
      if (!chart.isConnected) return;
      const whole = from <= 0 && to >= X;
      panels.forEach((panel, k) => {
        let low = 0, high = Y;
        if (!whole && panel.dataset.follows) [low, high] = heights(plots[k]);
        plots[k].querySelector("svg").setAttribute("viewBox", `${from} ${low} ${to - from} ${high - low}`);
        const bottom = +panel.dataset.low, top = +panel.dataset.high;
        const value = y => top - y / Y * (top - bottom);
        spread(panel.querySelector(".scale"), ticks(value(high), value(low), panel.classList.contains("small") ? 3 : 4)
          .map(([t, v]) => [t, 100 * (value(low) - v) / (value(low) - value(high))]), "top");
      });
      const a = start + from / X * (stop - start), b = start + to / X * (stop - start);
      spread(axis, ticks(a, b, axis.clientWidth < 420 ? 4 : 6).map(([t, v]) => [t, 100 * (v - a) / (b - a)]), "left");
      chart.classList.toggle("zoomed", !whole);
      chart.dataset.from = a; chart.dataset.to = b;
      if (said) said.textContent = whole ? "" : `${a.toPrecision(4)} to ${b.toPrecision(4)}`;
    };
    const show = (a, b) => {
      const width = Math.min(Math.max(b - a, 200), X);
      from = Math.min(Math.max((a + b) / 2 - width / 2, 0), X - width);
      to = from + width;
      draw();
    };
    const zoom = (factor, at = (from + to) / 2) => show(at - (at - from) * factor, at + (to - at) * factor);
    const pan = share => { const d = share * (to - from); if (from + d < 0) show(0, to - from);
      else if (to + d > X) show(X - (to - from), X); else show(from + d, to + d); };
    const place = event => {
      const box = plots[0].getBoundingClientRect();
      return from + (event.clientX - box.left) / box.width * (to - from);
    };
    const actions = { in: () => zoom(0.5), out: () => zoom(2), left: () => pan(-0.4), right: () => pan(0.4), all: () => show(0, X) };
    chart.querySelectorAll("button[data-do]").forEach(b => b.addEventListener("click", () => actions[b.dataset.do]()));
    const keys = { "+": "in", "=": "in", "-": "out", ArrowLeft: "left", ArrowRight: "right", "0": "all", Home: "all" };
    chart.querySelector(".panels").addEventListener("keydown", event => {
      if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      actions[keys[event.key]]();
    });
    const held = new Map();
    plots.forEach(plot => {
      // The wheel scrolls the page unless a key says that it is meant for the chart.
      plot.addEventListener("wheel", event => {
        if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
        event.preventDefault();
        zoom(Math.exp((event.deltaY || event.deltaX) * 0.0015), place(event));
      }, { passive: false });
      plot.addEventListener("dblclick", event => zoom(0.4, place(event)));
      plot.addEventListener("pointerdown", event => { held.set(event.pointerId, event); plot.setPointerCapture(event.pointerId); });
      plot.addEventListener("pointermove", event => {
        const before = held.get(event.pointerId);
        if (!before) return;
        const width = plot.getBoundingClientRect().width;
        if (held.size === 2) {
          const other = [...held.values()].find(h => h.pointerId !== event.pointerId);
          const then = Math.abs(before.clientX - other.clientX), now = Math.abs(event.clientX - other.clientX);
          if (then > 10 && now > 10) zoom(then / now, (place(event) + place(other)) / 2);
        } else if (to - from < X) pan(-(event.clientX - before.clientX) / width);
        held.set(event.pointerId, event);
      });
      for (const end of ["pointerup", "pointercancel"]) plot.addEventListener(end, event => held.delete(event.pointerId));
    });
    addEventListener("resize", draw);
    draw();
  };
  const setUpAll = () => document.querySelectorAll(".jaxid-page .chart").forEach(setUp);
  setUpAll();
  addEventListener("jaxid-drawn", setUpAll);  // a page that grows says so
  document.addEventListener("toggle", event => { if (event.target.closest(".jaxid-page")) dispatchEvent(new Event("resize")); }, true);
  const opened = [];
  addEventListener("beforeprint", () => document.querySelectorAll(".jaxid-page details:not([open])").forEach(d => { d.open = true; opened.push(d); }));
  addEventListener("afterprint", () => opened.splice(0).forEach(d => { d.open = false; }));
})();
