// Driving by hand: keys, a gamepad or the pad say where to, and only as long as they are held.

const PERIOD_MS = 50;
const KEYS = {
  KeyW: [1, 0], ArrowUp: [1, 0], KeyS: [-1, 0], ArrowDown: [-1, 0],
  KeyA: [0, 1], ArrowLeft: [0, 1], KeyD: [0, -1], ArrowRight: [0, -1],
};
// Of a stick's way: worn sticks rest so far beside the middle. Chosen by hand.
const DEAD_ZONE = 0.12;
// Of the standard mapping: either shoulder button is the dead man's switch of a gamepad.
const SHOULDERS = [4, 5];

const element = (id) => document.getElementById(id);
const clamp = (value) => Math.min(1, Math.max(-1, value));
const STILL = { held: false, forward: 0, left: 0 };

export class Hand {
  /** say(words, tone) tells the user something; handBack() asks for following. */
  constructor(say, handBack) {
    this.say = say;
    this.socket = null;
    this.beat = -1;
    this.source = "";
    this.keys = new Set();
    this.pointer = null;
    this.told = STILL;
    this.pad = element("pad");
    element("take").onclick = () => this.take();
    element("hand-back").onclick = () => { this.letGo(); this.leave(); handBack(); };
    addEventListener("keydown", (event) => this.key(event, true));
    addEventListener("keyup", (event) => this.key(event, false));
    // Without the focus no key is heard to be let go.
    addEventListener("blur", () => this.letGo());
    addEventListener("pagehide", () => this.letGo());
    document.addEventListener("visibilitychange", () => this.letGo());
    this.pad.addEventListener("pointerdown", (event) => { this.pad.setPointerCapture(event.pointerId); this.point(event); });
    this.pad.addEventListener("pointermove", (event) => { if (this.pointer) this.point(event); });
    for (const over of ["pointerup", "pointercancel", "lostpointercapture"]) this.pad.addEventListener(over, () => this.point(null));
    setInterval(() => this.tick(), PERIOD_MS);
  }

  get drives() {
    return this.socket?.readyState === WebSocket.OPEN && this.source !== "";
  }

  take() {
    this.leave();
    const socket = this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/hand`);
    socket.onmessage = ({ data }) => {
      const told = JSON.parse(data);
      if (told.beat !== undefined) this.beat = told.beat;
      if (told.source !== undefined) { this.source = told.source; this.pad.focus(); }
    };
    socket.onclose = ({ reason, wasClean }) => {
      if (this.socket !== socket) return;
      this.leave();
      this.say(reason || (wasClean ? "Driving by hand has ended" : "Driving by hand: no connection"), "bad");
    };
  }

  leave() {
    const socket = this.socket;
    this.socket = null;
    this.source = "";
    socket?.close();
  }

  /** What the follower says of who drives. */
  show(follower, lost) {
    const by = follower?.driven_by ?? "";
    if (this.drives && follower && by !== this.source && this.seen) {
      this.leave();
      this.say(by ? "Somebody else drives by hand now" : "The follower drives again", "calm");
    }
    // The follower's word comes a moment later than its grant.
    this.seen = this.drives && (this.seen || by === this.source);
    const mine = this.drives;
    document.body.toggleAttribute("data-hand", mine);
    element("pad").hidden = element("hand-help").hidden = !mine;
    element("take").hidden = mine;
    element("hand-back").hidden = !by && !mine;
    const page = by.startsWith("web/") ? by.split(" ")[1] : "";
    const who = page ? `a page at ${page}` : by;
    const words = lost ? "unknown" : mine ? "you, by hand" : by ? `${who}, by hand` : follower ? "the follower" : "not known";
    if (element("driver").textContent !== words) element("driver").textContent = words;
    const take = by && !mine ? "Take over" : "Drive by hand";
    if (element("take").textContent !== take) element("take").textContent = take;
  }

  key(event, down) {
    if (!this.drives || !(event.code in KEYS)) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (event.repeat) return;
    if (down) this.keys.add(event.code); else this.keys.delete(event.code);
    this.tick();
  }

  /** Where on the pad it is pressed, from its middle; null: nowhere. */
  point(event) {
    if (!event) {
      this.pointer = null;
    } else {
      const { left, top, width, height } = this.pad.getBoundingClientRect();
      this.pointer = [clamp(1 - (2 * (event.clientY - top)) / height), clamp(1 - (2 * (event.clientX - left)) / width)];
    }
    this.tick();
  }

  letGo() {
    this.keys.clear();
    this.pointer = null;
    this.send(STILL);
  }

  wish() {
    if (document.hidden || !document.hasFocus()) return STILL;
    if (this.keys.size) {
      let [forward, left] = [0, 0];
      for (const key of this.keys) { forward += KEYS[key][0]; left += KEYS[key][1]; }
      return { held: true, forward: clamp(forward), left: clamp(left) };
    }
    if (this.pointer) return { held: true, forward: this.pointer[0], left: this.pointer[1] };
    for (const gamepad of navigator.getGamepads?.() ?? []) {
      if (!gamepad?.connected || !SHOULDERS.some((button) => gamepad.buttons[button]?.pressed)) continue;
      const [across, down] = [0, 1].map((axis) => gamepad.axes[axis] ?? 0).map((way) => (Math.abs(way) < DEAD_ZONE ? 0 : way));
      return { held: true, forward: clamp(-down), left: clamp(-across) };
    }
    return STILL;
  }

  tick() {
    const wish = this.wish();
    if (wish.held || this.told.held) this.send(wish);
    const dot = this.pad.firstElementChild;
    dot.style.transform = `translate(${-40 * wish.left}px, ${-40 * wish.forward}px)`;
    this.pad.toggleAttribute("data-held", wish.held);
  }

  send(wish) {
    if (this.drives) this.socket.send(JSON.stringify({ beat: this.beat, ...wish }));
    this.told = wish;
  }
}
