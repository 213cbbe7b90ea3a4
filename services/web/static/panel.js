// Everything beside the picture: banners, follower, gauges, services. Text only, never markup.

const SILENT_DRIVE_S = 0.5;
const UNCONFIRMED_S = 1;
const RESUME_GUARD_MS = 700;
const TOAST_MS = 4000;
const PRESSED_MS = 1500;
const OLD_TRACKS_S = 0.5;
const RATE_WINDOW_MS = 2000;
const SPOKEN_EVERY_MS = 2000;
const MOST_PROBLEMS = 3;
const OWN_SWITCH = "use the robot\u2019s own switch";
const STATE_TONES = {
  following: "good", "by hand": "calm", acquiring: "calm", idle: "wait", occluded: "warn", unsure: "warn",
  searching: "warn", lost: "bad", stopped: "bad",
};
const HINTS = { idle: "Click somebody in the picture to follow them." };
const element = (id) => document.getElementById(id);

function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function tone(node, value) {
  if (node.dataset.tone !== value) node.dataset.tone = value;
}

function make(tag, text, data = {}) {
  const node = document.createElement(tag);
  node.textContent = text;
  Object.assign(node.dataset, data);
  return node;
}

const ago = (seconds) => seconds < 1 ? "now" : seconds < 60 ? `${Math.floor(seconds)} s ago` : `${Math.floor(seconds / 60)} min ago`;
const percent = (share) => `${Math.round(share * 100)} %`;

export class Panel {
  constructor() {
    this.status = null;
    this.statusAt = 0;
    this.drawn = [];
    this.scales = { linear: 0.5, angular: 1, "drive-linear": 0.5, "drive-angular": 1 };
    this.wasStopped = false;
    this.pressed = false;
    this.sentAt = 0;
    this.unsentStop = "";
    this.lost = "";
    this.said = { at: 0, text: "" };
    this.pendingSeq = null;
  }

  update(status) {
    this.status = status;
    this.statusAt = performance.now();
    if (this.stopped || (this.sentAt && this.statusAt - this.sentAt > PRESSED_MS)) this.pressed = false;
    put(element("camera"), status.camera);
    this.showNotices();
    this.showStop();
    this.showFollower();
    this.showDrive();
    this.showServices();
  }

  get stopped() {
    return Boolean(this.status?.stop.engaged);
  }

  /** STOP was pressed here, and not yet taken by the service. */
  press() {
    this.pressed = true;
    this.sentAt = 0;
    this.showStop();
  }

  /** The service has it; what the robot makes of it, the next status tells. */
  sent() {
    this.unsentStop = "";
    this.sentAt = performance.now();
    this.showStop();
  }

  /** Whoever resumes has not pressed STOP any more. */
  release() {
    this.pressed = false;
    this.unsentStop = "";
  }

  /** What became of the last STOP: [state, what the button says, and the line below it]. */
  stopOutcome() {
    if (this.unsentStop) return ["unsure", "NOT SENT", OWN_SWITCH];
    if (this.pressed && !this.stopped) return this.sentAt ? ["pending", "STOPPING", "sent"] : ["pending", "STOP", "pressed: sending it"];
    const watching = document.body.dataset.role === "watch";
    if (!this.stopped) return ["", "STOP", watching ? "you are logged in to watch" : "or press Esc"];
    const { stop, drive } = this.status;
    const by = stop.source ? ` \u00b7 by ${this.stopper(stop.source)}` : "";
    if (stop.confirmed_by === "drive") return ["stopped", "STOPPED", `the wheels stand${by}`];
    if (stop.confirmed_by === "follower") return ["stopped", "STOPPED", `the follower confirms, no drive is heard${by}`];
    const awaited = drive ? "drive" : "follower";
    if (stop.unconfirmed_s === null || stop.unconfirmed_s < UNCONFIRMED_S) return ["pending", "STOPPING", `sent: waiting for the ${awaited}`];
    return ["unsure", "NOT CONFIRMED", OWN_SWITCH];
  }

  stopper(source) {
    const page = source.startsWith("web/") ? source.split(" ")[1] : null;
    return page ? `a page at ${page}` : source;
  }

  showStop() {
    const [state, label, note] = this.stopOutcome();
    const button = element("stop");
    if (button.dataset.state !== state) button.dataset.state = state;
    put(button.firstElementChild, label);
    put(element("stop-note"), note);
    const resume = element("resume");
    resume.hidden = !this.stopped;
    if (this.stopped && !this.wasStopped) {
      // A second tap meant for STOP must not resume.
      resume.disabled = true;
      setTimeout(() => { resume.disabled = document.body.dataset.role === "watch"; }, RESUME_GUARD_MS);
    }
    this.wasStopped = this.stopped;
  }

  showNotices() {
    const notices = this.status.notices.map(({ service, text }) => `${service}: ${text}`);
    const wanted = notices.join("\n");
    if (wanted === this.shownNotices) return;
    this.shownNotices = wanted;
    element("notices").replaceChildren(...notices.map((notice) => make("p", notice)));
  }

  problem(part) {
    return this.status.problems.find((problem) => problem.part === part && problem.kind !== "doubled");
  }

  showFollower() {
    const { follower, command, problems } = this.status;
    const absent = this.problem("follower");
    const blind = problems.find(({ part, kind }) => kind !== "doubled" && ["capture", "simulator", "detector", "tracker"].includes(part));
    const byHand = follower?.driven_by && follower.state === "idle";
    const state = this.lost ? "unknown" : absent ? absent.kind : byHand ? "by hand" : follower?.state ?? "unknown";
    const pill = element("state");
    put(pill, state);
    tone(pill, this.lost || absent ? "bad" : STATE_TONES[state] ?? "wait");
    const target = follower?.target;
    put(element("target"), this.targetWords(target));
    const reason = this.lost || absent?.words || (follower && blind && follower.state !== "stopped" ? `${blind.words}; ${follower.reason}` : follower?.reason);
    put(element("reason"), reason ?? "no follower has been heard yet");
    const told = /click|choose/i.test(follower?.reason ?? "");
    put(element("hint"), !this.lost && !absent && !byHand && target?.mode === "none" && !told ? HINTS[follower.state] ?? "" : "");
    const known = this.lost || absent ? null : follower;
    this.showFacts(known);
    this.showStory(known ? this.status.story : []);
    for (const [id, mode] of [["nearest", "nearest"], ["none", "none"]]) {
      const pressed = String(target?.mode === mode);
      if (element(id).getAttribute("aria-pressed") !== pressed) element(id).setAttribute("aria-pressed", pressed);
    }
    this.watchPending(target);
    const old = !command || command.age_s > command.ttl_s;
    this.gauge("linear", command?.linear_mps, old, "m/s", 1);
    this.gauge("angular", command?.angular_radps, old, "rad/s", -1);
    this.say(`${state}. ${this.targetWords(target)}. ${reason ?? ""}`);
  }

  targetWords(target) {
    if (target?.track_id) return `person ${target.track_id}`;
    return { nearest: "the nearest person", imprint: "whoever stands before the robot", point: "somebody pointed at" }[target?.mode] ?? "nobody chosen";
  }

  /** How far, how sure, what bounds the speed, and whether anything looks out for obstacles. */
  showFacts(follower) {
    const facts = [];
    const seen = follower && (follower.tracks_age_s ?? 0) < OLD_TRACKS_S;
    if (seen && follower.distance_m != null) facts.push(`${follower.distance_m.toFixed(1)} m away`);
    if (seen && follower.identity_confidence != null) {
      const next = follower.runner_up_confidence;
      facts.push(`${percent(follower.identity_confidence)} sure${next >= 0.005 ? `, next best ${percent(next)}` : ""}`);
    }
    put(element("facts"), facts.join(" \u00b7 "));
    const speed = this.status.command?.linear_mps;
    put(element("speed-reason"), follower?.speed_reason && speed !== undefined ? `${speed.toFixed(2)} m/s: ${follower.speed_reason}` : "");
    const watch = element("watch");
    const free = follower?.free_distance_m;
    put(watch, !follower ? "" : follower.obstacle_watch ? `obstacles are watched${free != null ? `, ${free.toFixed(1)} m free` : ""}`
      : "nothing looks out for obstacles");
    tone(watch, follower && !follower.obstacle_watch ? "warn" : "");
  }

  /** What the tracker found out about the target's identity, the newest first. */
  showStory(story) {
    const lines = story.map(({ text, age_s }) => `${ago(age_s)}: ${text}`);
    const wanted = lines.join("\n");
    if (wanted === this.shownStory) return;
    this.shownStory = wanted;
    element("story").replaceChildren(...lines.map((line) => make("li", line)));
  }

  /** Say what became of a point at which somebody was looked for. */
  watchPending(target) {
    if (!target) return;
    if (target.mode === "point" && !target.track_id) {
      this.pendingSeq = target.seq;
    } else if (this.pendingSeq !== null) {
      this.pendingSeq = null;
      if (target.track_id) this.toast(`Following person ${target.track_id}`);
      else if (target.reason.startsWith("nobody")) this.toast("Nobody found there: click on somebody again", "calm");
    }
  }

  showDrive() {
    const { drive } = this.status;
    element("drive").hidden = !drive && !this.problem("drive");
    if (element("drive").hidden) return;
    const absent = this.problem("drive");
    const old = this.lost !== "" || !drive || drive.age_s > SILENT_DRIVE_S;
    // To stand because one was told to is no fault.
    const told = drive?.reason.startsWith("told to: ") && !drive.estop;
    const pill = element("drive-state");
    put(pill, absent && old ? absent.kind : old ? "silent" : told && drive.state === "stopped" ? "standing" : drive.state);
    tone(pill, old ? "bad" : drive.state === "driving" ? "good" : drive.state === "stopped" && !told ? "bad" : "wait");
    put(element("drive-reason"), this.lost || (old ? absent?.words ?? `no word for ${drive.age_s.toFixed(0)} s` : drive.reason));
    this.gauge("drive-linear", drive?.linear_mps, old, "m/s", 1);
    this.gauge("drive-angular", drive?.angular_radps, old, "rad/s", -1);
  }

  // Left on the bar is left for the robot, so a positive turn rate grows to the left.
  gauge(name, value, old, unit, direction) {
    const bar = element(`${name}-bar`);
    const row = bar.closest(".gauge");
    const unknown = old || this.lost !== "";
    row.toggleAttribute("data-old", unknown);
    if (value === undefined || unknown) {
      put(element(name), unknown && value !== undefined ? "none" : "\u2013");
      bar.style.width = "0";
      return;
    }
    this.scales[name] = Math.max(this.scales[name], Math.abs(value));
    const share = (50 * Math.abs(value)) / this.scales[name];
    bar.style.width = `${share}%`;
    bar.style.left = value * direction >= 0 ? "50%" : `${50 - share}%`;
    put(element(name), `${value.toFixed(2)} ${unit}`);
  }

  showServices() {
    const { services, web, own, unlisted } = this.status;
    const rows = services.map((service) => {
      const absent = service.heard !== "ok";
      const shade = service.heard === "ended" ? "off" : absent || service.state === "error" ? "bad"
        : service.state === "ok" ? "good" : "warn";
      const row = make("tr", "", { tone: shade });
      const name = service.instance === "main" ? service.service : `${service.service} ${service.instance}`;
      const age = `${service.age_ms_p50.toFixed(0)} / ${service.age_ms_p95.toFixed(0)}`;
      const figures = absent ? [service.heard, "", service.heard === "ended" ? "" : `${service.silent_s.toFixed(0)} s`, ""]
        : [service.rate_in_hz.toFixed(0), service.rate_out_hz.toFixed(0), age, service.dropped];
      row.append(...[name, ...figures].map((text) => make("td", String(text))));
      return row;
    });
    element("services").replaceChildren(...rows);
    const complaints = services
      .filter((service) => service.reason && service.heard === "ok" && service.producer !== own)
      .map((service) => `${service.service}: ${service.reason}`);
    const malformed = services.reduce((sum, service) => sum + service.malformed, 0);
    if (malformed) complaints.push(`${malformed} malformed messages refused`);
    if (unlisted) complaints.push(`${unlisted} further senders of health are not listed`);
    if (web.unreadable) complaints.push(`${web.unreadable} pictures could not be read`);
    if (complaints.join("\n") === this.shownComplaints) return;
    this.shownComplaints = complaints.join("\n");
    element("problems").replaceChildren(...complaints.map((text) => make("li", text)));
  }

  /** A frame was drawn. */
  showFrame(header) {
    this.drawn.push(performance.now());
    this.frameAge = header.age_ms;
    element("no-tracks").hidden = header.tracks !== null;
    put(element("viewer"), `this page: frame ${header.index + 1}, ${header.dropped} dropped for a slow viewer`);
  }

  /** Called several times a second: ages grow even when nothing arrives. */
  tick(link) {
    const oldest = performance.now() - RATE_WINDOW_MS;
    this.drawn = this.drawn.filter((drawnAt) => drawnAt > oldest);
    const rate = (1000 * this.drawn.length) / RATE_WINDOW_MS;
    put(element("figures"), rate && !this.lost ? `${rate.toFixed(0)} fps \u00b7 ${this.frameAge.toFixed(0)} ms` : "");
    const banners = this.banners(link);
    const wanted = banners.map((banner) => banner.join()).join("|");
    if (wanted !== this.shownBanners) {
      this.shownBanners = wanted;
      element("banners").replaceChildren(...banners.map(([shade, text]) => make("p", text, { tone: shade })));
    }
    // Spoken once for each kind of alarm, not again with every second that it lasts.
    put(element("alarm"), banners.filter(([shade]) => shade !== "calm").map(([, text]) => text.replace(/ for \d+ s| in \d+ s/g, "")).join(". "));
    this.lose(link);
    const pill = element("link");
    const cut = !link.connected || link.silentS > 0;
    const ill = Boolean(this.lost) || this.status?.problems.length > 0;
    put(pill, cut ? "reconnecting" : this.lost ? "cut off" : this.stale ? "stale" : this.ended ? "ended" : ill ? "fault" : "live");
    tone(pill, this.lost || ill ? "bad" : this.stale ? "warn" : this.ended ? "calm" : "good");
    element("stage").toggleAttribute("data-stale", Boolean(this.lost) || this.stale);
  }

  /** What is shown is old: then all of it is grey, and no number passes for the present. */
  lose(link) {
    const { status } = this;
    const silent = Math.floor((performance.now() - this.statusAt) / 1000);
    const lost = !status ? ""
      : !link.connected || link.silentS ? `no word from the web service for ${Math.max(1, silent)} s`
        : !status.router ? "the router is away"
          : status.bus_silent_s !== null ? "nothing is heard from any service" : "";
    document.body.toggleAttribute("data-lost", lost !== "");
    if (lost === this.lost) return;
    this.lost = lost;
    this.showStop();
    this.showFollower();
    this.showDrive();
  }

  banners(link) {
    const banners = [];
    this.stale = false;
    this.ended = Boolean(this.status?.picture.ended);
    if (this.unsentStop) banners.push(["bad", this.unsentStop]);
    if (!link.connected) {
      const seconds = Math.max(0, (link.retryAt - performance.now()) / 1000);
      banners.push(["bad", this.status ? `Connection to the web service lost: trying again${seconds >= 1 ? ` in ${Math.ceil(seconds)} s` : ""}` : "Connecting to the web service"]);
    } else if (link.silentS && this.status) {
      banners.push(["bad", `No word from the web service for ${Math.floor(Math.max(1, link.silentS))} s`]);
    }
    if (!this.status) return banners;
    const { router, picture, camera, problems, bus_silent_s: busSilentS } = this.status;
    const since = (performance.now() - this.statusAt) / 1000;
    if (!this.unsentStop && this.stopOutcome()[1] === "NOT CONFIRMED") {
      banners.push(["bad", `STOP was sent, but ${this.status.drive ? "the drive has not confirmed it" : "nobody has confirmed it"}: ${OWN_SWITCH}`]);
    }
    if (banners.length && !link.connected) return banners;
    if (!router) banners.push(["bad", "The Zenoh router is away: nothing can be seen or sent until it is back"]);
    else if (busSilentS !== null) banners.push(["bad", `Nothing is heard from any service for ${Math.floor(busSilentS)} s: is the router hanging?`]);
    else for (const { words } of problems.slice(0, MOST_PROBLEMS)) banners.push(["bad", words]);
    if (picture.ended) {
      banners.push(["calm", `The stream ended after ${picture.ended.frames} frames: ${picture.ended.reason}`]);
    } else if (picture.age_s === null) {
      banners.push(["calm", `Waiting for the first picture of camera \u201c${camera}\u201d`]);
    } else if (picture.age_s + since > picture.stale_after_s) {
      this.stale = true;
      banners.push(["warn", `No picture for ${Math.floor(picture.age_s + since)} s`]);
    }
    return banners;
  }

  /** For those who do not see the panel: state and reason, when they have changed, without haste. */
  say(text) {
    const words = text.replace(/\d+(\.\d+)? s\b/g, "some seconds");
    const now = performance.now();
    if (words === this.said.text || now - this.said.at < SPOKEN_EVERY_MS) return;
    this.said = { at: now, text: words };
    put(element("spoken"), words);
  }

  toast(text, shade = "good") {
    const toast = element("toast");
    put(toast, text);
    toast.dataset.tone = shade;
    toast.hidden = false;
    clearTimeout(this.toastTimer);
    this.toastTimer = setTimeout(() => { toast.hidden = true; }, TOAST_MS);
  }
}
