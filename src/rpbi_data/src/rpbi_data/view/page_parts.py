"""HTML text of the plots below viser's 3-D view. The plots follow viser's time line."""

HEAD = """<style>
body { display: flex; flex-direction: column; }
#root { flex: 1 1 60%; min-height: 0; height: auto !important; }
#episode { flex: 0 1 auto; max-height: 45%; overflow-y: auto; box-sizing: border-box; padding: 4px 10px 8px;
  border-top: 1px solid #ddd; background: #fff; color: #222; font-size: 13px; }
#episode h1 { display: inline; font-size: 14px; margin: 0 1em 0 0; }
#episode p, #episode ul { margin: 2px 0; }
#episode .contact { color: #d62728; } #episode .sensor { color: #1f77b4; }
#episode canvas { display: block; width: 100%; height: 100px; cursor: crosshair; }
#episode .key { margin-right: 1em; white-space: nowrap; font-variant-numeric: tabular-nums; }
</style>"""

BODY = """<div id="episode"><h1></h1><span id="legend"></span>
<ul id="notes"></ul><div id="panels"></div></div>
<script>
(() => {
  const COLOURS = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b", "#e377c2", "#17becf"];
  const LEFT = 52, BOTTOM = 18, TOP = 4, RIGHT = 6;
  const byId = (id) => document.getElementById(id);
  const element = (tag, text, parent, name) => {
    const made = document.createElement(tag);
    made.textContent = text;
    if (name) made.className = name;
    parent.append(made);
    return made;
  };
  document.querySelector("#episode h1").textContent = EPISODE.title;
  byId("legend").textContent = EPISODE.legend + "; ";
  element("span", "contacts", byId("legend"), "contact");
  byId("legend").append(", ");
  element("span", "sensors", byId("legend"), "sensor");
  for (const note of EPISODE.notes) element("li", note, byId("notes"));

  // Time of viser's time line, in the bar below its view; null while the page loads.
  const time = () => {
    const slider = document.querySelector("#root [role=slider]");
    return slider ? Number(slider.getAttribute("aria-valuenow")) : null;
  };
  const seek = (seconds) => {
    const input = document.querySelector("#root input[inputmode]");
    if (!input) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(input, seconds.toFixed(3));
    input.dispatchEvent(new Event("input", { bubbles: true }));
  };

  const steps = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((each) => each * power >= raw);
    const found = [];
    for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) found.push(value);
    return [found, Math.max(0, -Math.floor(Math.log10(step)))];
  };

  class Panel {
    constructor(panel) {
      this.lines = panel.lines;
      const head = element("p", panel.title + "  ", byId("panels"));
      this.values = this.lines.map((line, i) => {
        const key = element("span", line.name, head, "key");
        key.style.color = COLOURS[i % COLOURS.length];
        return key;
      });
      this.canvas = element("canvas", "", byId("panels"));
      const go = (event) => {
        if (!event.buttons) return;
        const share = (event.offsetX - LEFT) / (this.canvas.clientWidth - LEFT - RIGHT);
        seek(EPISODE.seconds * Math.min(1, Math.max(0, share)));
      };
      this.canvas.addEventListener("pointerdown", go);
      this.canvas.addEventListener("pointermove", go);
      let low = 0, high = 0;
      for (const line of this.lines) for (const y of line.y) { low = Math.min(low, y); high = Math.max(high, y); }
      const margin = 0.05 * (high - low || 1);
      [this.low, this.high] = [low - margin, high + margin];
    }
    x(seconds) { return LEFT + (this.width - LEFT - RIGHT) * seconds / EPISODE.seconds; }
    y(value) { return TOP + (this.height - TOP - BOTTOM) * (this.high - value) / (this.high - this.low); }
    resize() {
      [this.width, this.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
      const scale = window.devicePixelRatio || 1;
      this.canvas.width = this.width * scale;
      this.canvas.height = this.height * scale;
      this.picture = document.createElement("canvas");
      [this.picture.width, this.picture.height] = [this.canvas.width, this.canvas.height];
      const pen = this.picture.getContext("2d");
      pen.scale(scale, scale);
      pen.font = "11px sans-serif";
      pen.lineWidth = 1;
      pen.textAlign = "right";
      pen.textBaseline = "middle";
      const [values, digits] = steps(this.low, this.high, 4);
      this.digits = digits + 2;
      for (const value of values) {
        this.stroke(pen, "#e4e4e4", [[LEFT, this.y(value)], [this.width - RIGHT, this.y(value)]]);
        pen.fillText(value.toFixed(digits), LEFT - 5, this.y(value));
      }
      pen.textAlign = "center";
      const [times, timeDigits] = steps(0, EPISODE.seconds, Math.max(2, this.width / 110));
      for (const at of times) {
        this.stroke(pen, "#e4e4e4", [[this.x(at), TOP], [this.x(at), this.height - BOTTOM]]);
        pen.fillText(at.toFixed(timeDigits) + " s", Math.min(this.x(at), this.width - 16), this.height - 8);
      }
      pen.lineWidth = 1.2;
      this.lines.forEach((line, i) =>
        this.stroke(pen, COLOURS[i % COLOURS.length], line.x.map((at, j) => [this.x(at), this.y(line.y[j])])));
    }
    stroke(pen, colour, points) {
      pen.strokeStyle = colour;
      pen.beginPath();
      points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.stroke();
    }
    show(seconds) {
      if (this.canvas.clientWidth !== this.width || this.canvas.clientHeight !== this.height) this.resize();
      const pen = this.canvas.getContext("2d");
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
      pen.drawImage(this.picture, 0, 0);
      if (seconds === null) return;
      const scale = this.canvas.width / this.width;
      pen.scale(scale, scale);
      this.stroke(pen, "#000", [[this.x(seconds), TOP], [this.x(seconds), this.height - BOTTOM]]);
      this.lines.forEach((line, i) => {
        let low = 0, high = line.x.length;
        while (low < high) {
          const middle = (low + high) >> 1;
          if (line.x[middle] <= seconds) low = middle + 1; else high = middle;
        }
        this.values[i].textContent = line.name + (low ? " " + line.y[low - 1].toFixed(this.digits) : "");
      });
    }
  }
  const panels = EPISODE.panels.map((panel) => new Panel(panel));
  let shown = -1;
  const follow = () => {
    const now = time();
    if (now !== shown || panels.some((panel) => panel.canvas.clientWidth !== panel.width))
      panels.forEach((panel) => panel.show(now));
    shown = now;
    requestAnimationFrame(follow);
  };
  follow();
})();
</script>"""
