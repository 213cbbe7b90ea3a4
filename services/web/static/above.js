// The simulated world seen from above, drawn from what the simulator says is true. The stack never sees it.

const ACROSS_M = 16;
const TRAIL_POINTS = 240;
const TRAIL_STEP_M = 0.08;
const MAX_TRAILS = 65;
const GONE_MS = 3000;
const LEAST_OVERLAP = 0.25;
const ROLE_COLOURS = { target: "#ffd166", twin: "#ff7eb6", other: "#7f93a8" };
const ROLE_WORDS = { target: "the scenario\u2019s person", twin: "dressed alike" };
const STATE_COLOURS = {
  following: "#4fd1a5", acquiring: "#6cb6ff", idle: "#93a3b3", occluded: "#ffb454", unsure: "#ffb454",
  searching: "#ffb454", lost: "#ff5d5d", stopped: "#ff5d5d",
};
const FILLS = { wall: "#55636f", pillar: "#8794a0", furniture: "#6b5a46" };

export class Above {
  /** @param {HTMLElement} stage what holds the canvas; hidden while no simulator speaks */
  constructor(stage) {
    this.stage = stage;
    this.canvas = stage.querySelector("canvas");
    this.caption = stage.querySelector(".caption");
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.world = null;
    this.truth = null;
    this.heardAt = -Infinity;
    this.trails = new Map();
    this.state = "idle";
    this.frame = null;
    new ResizeObserver(() => this.draw()).observe(stage);
  }

  showWorld(world) {
    this.world = world;
    this.trails.clear();
  }

  showTruth(truth) {
    if (this.truth && truth.t_s < this.truth.t_s) this.trails.clear();
    this.truth = truth;
    this.heardAt = performance.now();
    this.remember("robot", truth.robot);
    for (const person of truth.people) this.remember(person.id, person.pose);
    this.draw();
  }

  /** What the robot's own side says: the follower's state, and the picture's boxes. */
  showState(state) {
    this.state = state ?? "idle";
  }

  showFrame(header) {
    this.frame = header;
  }

  /** Called several times a second. */
  tick() {
    const present = this.world !== null && performance.now() - this.heardAt < GONE_MS;
    this.stage.hidden = !present;
  }

  remember(name, [x, y]) {
    const trail = this.trails.get(name) ?? [];
    const last = trail[trail.length - 1];
    if (!last || Math.hypot(x - last[0], y - last[1]) > TRAIL_STEP_M) trail.push([x, y, this.state]);
    if (trail.length > TRAIL_POINTS) trail.shift();
    if (this.trails.has(name) || this.trails.size < MAX_TRAILS) this.trails.set(name, trail);
  }

  /**
   * Who is under which of the picture's boxes: the stack's ids by the simulator's people. The map
   * names people as the picture does, or not at all.
   */
  names() {
    const seen = this.truth.people.filter((person) => person.box && person.visible > 0);
    const tracks = (this.frame?.tracks ?? []).filter((track) => track.shown && track.state !== "lost");
    const under = (track) => seen.map((person) => [overlap(person.box, track.box), track.id, person])
      .sort(([one], [other]) => other - one)[0];
    const pairs = tracks.map(under).filter((best) => best && best[0] > LEAST_OVERLAP).sort(([one], [other]) => other - one);
    const names = new Map();
    // Whom two boxes fit best has the name of the better one; the other box is nobody's.
    for (const [, id, person] of pairs) if (!names.has(person)) names.set(person, id);
    return names;
  }

  draw() {
    const { canvas, world, truth } = this;
    if (!world || !truth || !canvas.clientWidth) return;
    const density = Math.min(devicePixelRatio || 1, 2);
    canvas.width = Math.round(canvas.clientWidth * density);
    canvas.height = Math.round(canvas.clientHeight * density);
    this.unit = density;
    this.scale = Math.min(canvas.width, canvas.height) / ACROSS_M;
    const names = this.names();
    const target = this.frame?.target?.id;
    const followed = [...names].find(([, id]) => id === target)?.[0] ?? null;
    this.drawGround();
    for (const thing of world.obstacles) this.drawObstacle(thing);
    for (const person of truth.people) this.drawTrail(person.id, () => ROLE_COLOURS[person.role], 1.5);
    this.drawTrail("robot", (state) => STATE_COLOURS[state], 3);
    if (followed) this.drawTie(followed);
    for (const person of truth.people) this.drawPerson(person, names.get(person), person === followed);
    this.drawRobot();
    this.caption.textContent = `${world.scenario}, seed ${world.seed} \u00b7 ${truth.t_s.toFixed(0)} s \u00b7 `
      + `${truth.linear_mps.toFixed(2)} m/s \u00b7 ${truth.contacts} contacts`;
    // For those who look from outside, screen readers and tests.
    canvas.dataset.followed = followed?.id ?? "";
    canvas.dataset.people = JSON.stringify(truth.people.filter((one) => one.box).map((one) => [one.id, ...one.box]));
    canvas.dataset.names = JSON.stringify([...names].map(([person, id]) => [person.id, id]));
    canvas.dataset.speed = truth.linear_mps;
    canvas.dataset.time = truth.t_s;
  }

  /** A place in pixels of the canvas; x of the world goes right, y up, the robot is in the middle. */
  at(x, y) {
    const [middleX, middleY] = this.truth.robot;
    return [
      this.canvas.width / 2 + (x - middleX) * this.scale,
      this.canvas.height / 2 - (y - middleY) * this.scale,
    ];
  }

  drawGround() {
    const { context, canvas, scale } = this;
    context.fillStyle = "#0a0f14";
    context.fillRect(0, 0, canvas.width, canvas.height);
    const [left, bottom, right, top] = this.world.bounds;
    const corner = this.at(left, top);
    context.fillStyle = "#151d26";
    context.fillRect(...corner, (right - left) * scale, (top - bottom) * scale);
    context.strokeStyle = "#1f2a35";
    context.lineWidth = this.unit;
    context.beginPath();
    const [robotX, robotY] = this.truth.robot;
    const reach = Math.ceil(Math.max(canvas.width, canvas.height) / scale / 2) + 1;
    for (let metre = -reach; metre <= reach; metre += 1) {
      const [x, y] = this.at(Math.round(robotX) + metre, Math.round(robotY) + metre);
      context.moveTo(x, 0);
      context.lineTo(x, canvas.height);
      context.moveTo(0, y);
      context.lineTo(canvas.width, y);
    }
    context.stroke();
  }

  drawObstacle({ kind, pose: [x, y, heading], length, width }) {
    const { context, scale } = this;
    context.save();
    context.translate(...this.at(x, y));
    context.rotate(-heading);
    context.fillStyle = FILLS[kind];
    context.fillRect((-length / 2) * scale, (-width / 2) * scale, length * scale, width * scale);
    context.restore();
  }

  drawTrail(name, colourOf, width) {
    const { context } = this;
    const trail = this.trails.get(name) ?? [];
    context.lineWidth = width * this.unit;
    context.lineCap = "round";
    for (let i = 1; i < trail.length; i += 1) {
      context.globalAlpha = (0.75 * i) / trail.length;
      context.strokeStyle = colourOf(trail[i][2]);
      context.beginPath();
      context.moveTo(...this.at(...trail[i - 1]));
      context.lineTo(...this.at(...trail[i]));
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  drawTie({ pose }) {
    const { context, unit } = this;
    context.strokeStyle = STATE_COLOURS[this.state];
    context.lineWidth = 1.5 * unit;
    context.setLineDash([5 * unit, 5 * unit]);
    context.beginPath();
    context.moveTo(...this.at(...this.truth.robot));
    context.lineTo(...this.at(...pose));
    context.stroke();
    context.setLineDash([]);
  }

  drawPerson({ role, pose: [x, y, heading], radius }, name, isFollowed) {
    const { context, unit, scale } = this;
    const [left, top] = this.at(x, y);
    this.drawDisc(left, top, radius * scale, ROLE_COLOURS[role]);
    this.drawNose(left, top, heading, radius * scale, "#0b0f14");
    if (isFollowed) {
      context.strokeStyle = "#ffffff";
      context.lineWidth = 2.5 * unit;
      context.beginPath();
      context.arc(left, top, radius * scale + 4 * unit, 0, 2 * Math.PI);
      context.stroke();
    }
    context.fillStyle = isFollowed ? "#ffffff" : ROLE_COLOURS[role];
    context.font = `600 ${12 * unit}px system-ui, sans-serif`;
    const text = [name, ROLE_WORDS[role], isFollowed && "followed"].filter(Boolean).join(" \u00b7 ");
    const room = this.canvas.width - context.measureText(text).width - 6 * unit;
    context.fillText(text, Math.min(left + radius * scale + 7 * unit, room), top - radius * scale - 6 * unit);
  }

  drawRobot() {
    const [x, y, heading] = this.truth.robot;
    const [left, top] = this.at(x, y);
    const radius = this.truth.radius * this.scale;
    this.drawDisc(left, top, radius, STATE_COLOURS[this.state] ?? STATE_COLOURS.idle);
    this.drawNose(left, top, heading, radius, "#0b0f14");
    const { context, unit } = this;
    context.strokeStyle = "#e8eef4";
    context.lineWidth = 2 * unit;
    context.beginPath();
    context.arc(left, top, radius, 0, 2 * Math.PI);
    context.stroke();
  }

  drawDisc(left, top, radius, colour) {
    const { context } = this;
    context.fillStyle = colour;
    context.beginPath();
    context.arc(left, top, radius, 0, 2 * Math.PI);
    context.fill();
  }

  drawNose(left, top, heading, radius, colour) {
    const { context } = this;
    context.fillStyle = colour;
    context.beginPath();
    context.moveTo(left + radius * Math.cos(heading), top - radius * Math.sin(heading));
    for (const side of [2.4, -2.4]) {
      context.lineTo(left + 0.55 * radius * Math.cos(heading + side), top - 0.55 * radius * Math.sin(heading + side));
    }
    context.fill();
  }
}

// Intersection over union of two boxes.
function overlap(one, other) {
  const wide = Math.min(one[2], other[2]) - Math.max(one[0], other[0]);
  const high = Math.min(one[3], other[3]) - Math.max(one[1], other[1]);
  if (wide <= 0 || high <= 0) return 0;
  const area = ([left, top, right, bottom]) => (right - left) * (bottom - top);
  return (wide * high) / (area(one) + area(other) - wide * high);
}
