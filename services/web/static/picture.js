// The picture with what belongs to it: boxes, ids, states and trails of the very same frame.

const TRAIL_POINTS = 45;
const TRAIL_FRAMES = 75;
const UNSURE_BELOW = 0.6;
const TARGET_COLOUR = "#ffffff";
const PENDING_COLOUR = "#9cd0ff";
const EXPECTED_MS = 1500;

export const colourOf = (id) => `hsl(${(id * 137.508) % 360} 90% 67%)`;

export class Picture {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.header = null;
    this.source = "";
    this.trails = new Map();
    this.expected = null;
    new ResizeObserver(() => this.fit()).observe(canvas);
  }

  /** Draw a frame: pixels and marks in one go, so that they are never of different frames. */
  show(header, bitmap) {
    const ratio = header.width / header.height;
    if (ratio !== this.ratio) {
      this.ratio = ratio;
      document.documentElement.style.setProperty("--ratio", ratio);
      this.fit();
    }
    this.header = header;
    this.follow(header);
    this.keep(bitmap);
    this.draw();
  }

  // A copy of the pixels, so that a resized page can be drawn again.
  keep(bitmap) {
    this.pixels ??= document.createElement("canvas");
    if (this.pixels.width !== bitmap.width || this.pixels.height !== bitmap.height) {
      this.pixels.width = bitmap.width;
      this.pixels.height = bitmap.height;
    }
    this.pixels.getContext("2d").drawImage(bitmap, 0, 0);
  }

  fit() {
    const density = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * density));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * density));
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    if (this.header) this.draw();
  }

  follow(header) {
    const source = `${header.stream} ${header.epoch} ${header.tracker ?? this.source.split(" ")[2]}`;
    if (source !== this.source) {
      this.trails.clear();
      this.source = source;
    }
    for (const person of this.people()) {
      const [left, , right, bottom] = person.box;
      const trail = this.trails.get(person.id) ?? [];
      trail.push([(left + right) / 2, bottom, header.seq]);
      if (trail.length > TRAIL_POINTS) trail.shift();
      this.trails.set(person.id, trail);
    }
    for (const [id, trail] of this.trails) {
      if (header.seq - trail[trail.length - 1][2] > TRAIL_FRAMES) this.trails.delete(id);
    }
  }

  /** The people that are shown in the frame on display. */
  people() {
    return (this.header?.tracks ?? []).filter((person) => person.shown);
  }

  /** Frame coordinates of a pointer event. */
  locate(event) {
    const area = this.canvas.getBoundingClientRect();
    return [
      ((event.clientX - area.left) / area.width) * this.header.width,
      ((event.clientY - area.top) / area.height) * this.header.height,
    ];
  }

  /** The person at a point: of several boxes the one whose middle is nearest. */
  personAt(x, y) {
    const away = ({ box: [left, top, right, bottom] }) =>
      Math.hypot((x - (left + right) / 2) / (right - left), (y - (top + bottom) / 2) / (bottom - top));
    return this.people()
      .filter(({ box: [left, top, right, bottom] }) => x >= left && x <= right && y >= top && y <= bottom)
      .sort((one, other) => away(one) - away(other))[0];
  }

  draw() {
    const { context, canvas, header } = this;
    this.unit = canvas.width / Math.max(1, canvas.clientWidth);
    this.scaleX = canvas.width / header.width;
    this.scaleY = canvas.height / header.height;
    context.drawImage(this.pixels, 0, 0, canvas.width, canvas.height);
    const people = this.people();
    const isTarget = (person) => header.target?.id === person.id;
    for (const person of people) this.drawTrail(person);
    // The target's box comes last and its label gets the first choice of place.
    const ordered = [...people].sort((one, other) => isTarget(one) - isTarget(other));
    for (const person of ordered) this.drawBox(person, isTarget(person));
    this.labels = [];
    for (const person of ordered.reverse()) this.drawLabel(person, isTarget(person) ? header.target : null);
    this.drawPending();
    // For those who look from outside, screen readers and tests.
    canvas.dataset.seq = header.seq;
    canvas.dataset.boxes = JSON.stringify(people.map((person) => [person.id, ...person.box]));
  }

  /** Somebody was pointed at where nobody is tracked yet: shown until the follower tells where. */
  expect(x, y) {
    this.expected = { x, y, until: performance.now() + EXPECTED_MS };
    if (this.header) this.draw();
  }

  /** The follower has answered: from now on its word counts. */
  answered() {
    this.expected = null;
    if (this.header) this.draw();
  }

  /** Where somebody is looked for: the follower's own place, which goes along with the picture. */
  pendingPlace() {
    if (this.header.pending) return this.header.pending;
    const { expected } = this;
    return expected && performance.now() < expected.until ? [expected.x, expected.y] : null;
  }

  drawPending() {
    const { context, canvas, unit } = this;
    const place = this.pendingPlace();
    canvas.dataset.pending = place ? JSON.stringify(place) : "";
    if (!place) return;
    const [x, y] = [place[0] * this.scaleX, place[1] * this.scaleY];
    const turn = (performance.now() / 400) % (2 * Math.PI);
    for (const [colour, width] of [["#0b0f14", 6], [PENDING_COLOUR, 3]]) {
      context.strokeStyle = colour;
      context.lineWidth = width * unit;
      context.lineCap = "round";
      for (let part = 0; part < 3; part += 1) {
        const from = turn + (part * 2 * Math.PI) / 3;
        context.beginPath();
        context.arc(x, y, 20 * unit, from, from + 1.3);
        context.stroke();
      }
    }
    this.drawTag("looking for somebody there", x, y + 34 * unit, PENDING_COLOUR);
  }

  drawTag(text, x, y, colour) {
    const { context, canvas, unit } = this;
    context.font = `600 ${13 * unit}px system-ui, sans-serif`;
    context.textBaseline = "middle";
    const width = context.measureText(text).width + 12 * unit;
    const height = 21 * unit;
    const left = Math.max(0, Math.min(x - width / 2, canvas.width - width));
    const top = Math.max(0, Math.min(y - height / 2, canvas.height - height));
    context.fillStyle = colour;
    context.beginPath();
    context.roundRect(left, top, width, height, 5 * unit);
    context.fill();
    context.fillStyle = "#0b0f14";
    context.fillText(text, left + 6 * unit, top + height / 2 + unit);
  }

  drawTrail(person) {
    const { context, unit } = this;
    const trail = this.trails.get(person.id) ?? [];
    context.lineWidth = 3 * unit;
    context.lineCap = "round";
    context.strokeStyle = colourOf(person.id);
    for (let i = 1; i < trail.length; i += 1) {
      context.globalAlpha = (0.7 * i) / trail.length;
      context.beginPath();
      context.moveTo(trail[i - 1][0] * this.scaleX, trail[i - 1][1] * this.scaleY);
      context.lineTo(trail[i][0] * this.scaleX, trail[i][1] * this.scaleY);
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  /** The box of a person in pixels of the canvas: x, y, width, height. */
  place({ box: [left, top, right, bottom] }) {
    const { scaleX, scaleY } = this;
    return [left * scaleX, top * scaleY, (right - left) * scaleX, (bottom - top) * scaleY];
  }

  drawBox(person, isTarget) {
    const { context, unit } = this;
    const place = this.place(person);
    const dash = { occluded: [9 * unit, 6 * unit], lost: [2 * unit, 6 * unit] }[person.state] ?? [];
    context.globalAlpha = person.state === "lost" ? 0.65 : 1;
    context.lineCap = "butt";
    context.setLineDash(dash);
    context.lineWidth = (isTarget ? 4 : 2.5) * unit;
    context.strokeStyle = colourOf(person.id);
    context.strokeRect(...place);
    context.setLineDash([]);
    if (isTarget) this.drawCorners(...place);
    context.globalAlpha = 1;
  }

  drawCorners(x, y, width, height) {
    const { context, unit } = this;
    const gap = 7 * unit;
    const arm = Math.max(10 * unit, Math.min(width, height) * 0.22);
    context.lineWidth = 3 * unit;
    context.lineCap = "square";
    context.strokeStyle = TARGET_COLOUR;
    context.beginPath();
    for (const [cornerX, inX] of [[x - gap, 1], [x + width + gap, -1]]) {
      for (const [cornerY, inY] of [[y - gap, 1], [y + height + gap, -1]]) {
        context.moveTo(cornerX + inX * arm, cornerY);
        context.lineTo(cornerX, cornerY);
        context.lineTo(cornerX, cornerY + inY * arm);
      }
    }
    context.stroke();
  }

  label(person, target) {
    const parts = [`${person.id}`, `${Math.round(person.confidence * 100)}%`];
    const unsure = target?.state === "unsure" || person.confidence < UNSURE_BELOW;
    if (unsure) parts.push("unsure");
    if (person.state === "occluded") {
      parts.push(person.occluded_by.length ? `behind ${person.occluded_by.join(", ")}` : "occluded");
    } else if (person.state !== "tracked") {
      parts.push(person.state);
    }
    if (person.distance_m !== null) parts.push(`${person.distance_m.toFixed(1)} m`);
    return (target ? "\u25ce " : "") + parts.join(" \u00b7 ");
  }

  drawLabel(person, target) {
    const { context, unit } = this;
    const text = this.label(person, target);
    context.font = `${target ? 700 : 600} ${13 * unit}px system-ui, sans-serif`;
    context.textBaseline = "middle";
    const width = context.measureText(text).width + 12 * unit;
    const height = 21 * unit;
    const [left, top] = this.freePlace(this.place(person), width, height, (target ? 11 : 3) * unit);
    this.labels.push([left, top, width, height]);
    context.fillStyle = target ? TARGET_COLOUR : colourOf(person.id);
    context.beginPath();
    context.roundRect(left, top, width, height, 5 * unit);
    context.fill();
    context.fillStyle = "#0b0f14";
    context.fillText(text, left + 6 * unit, top + height / 2 + unit);
  }

  // Above the box, else below it, else further up: wherever no other label is.
  freePlace([x, y, , boxHeight], width, height, gap) {
    const { canvas, labels, unit } = this;
    const left = Math.max(0, Math.min(x - unit, canvas.width - width));
    const above = y - height - gap;
    const step = height + 2 * unit;
    const tops = [above, y + boxHeight + gap, above - step, above - 2 * step, y + gap]
      .filter((top) => top >= 0 && top + height <= canvas.height);
    const isFree = (top) => labels.every(([otherX, otherY, otherWidth, otherHeight]) =>
      left >= otherX + otherWidth || left + width <= otherX || top >= otherY + otherHeight || top + height <= otherY);
    return [left, tops.find(isFree) ?? tops[0] ?? 0];
  }
}
