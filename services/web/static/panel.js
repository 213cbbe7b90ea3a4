// Everything beside the picture: banners, follower, gauges, services. Text only, never markup.

import { colourOf } from "./picture.js";

const SILENT_SERVICE_S = 3;
const SILENT_DRIVE_S = 0.5;
const UNCONFIRMED_S = 1;
const RESUME_GUARD_MS = 700;
const TOAST_MS = 4000;
const RATE_WINDOW_MS = 2000;
const STATE_TONES = {
  following: "good", acquiring: "calm", idle: "wait", occluded: "warn", unsure: "warn",
  searching: "warn", lost: "bad", stopped: "bad",
};
const DRIVE_TONES = { driving: "good", waiting: "wait", stopped: "bad" };
const element = (id) => document.getElementById(id);

function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function make(tag, text, data = {}) {
  const node = document.createElement(tag);
  node.textContent = text;
  Object.assign(node.dataset, data);
  return node;
}

export class Panel {
  /** @param {(person: object) => void} onPerson called when a person's button is pressed */
  constructor(onPerson) {
    this.onPerson = onPerson;
    this.status = null;
    this.statusAt = 0;
    this.drawn = [];
    this.scales = { linear: 0.5, angular: 1, "drive-linear": 0.5, "drive-angular": 1 };
    this.wasStopped = false;
    this.unsentStop = "";
  }

  update(status) {
    this.status = status;
    this.statusAt = performance.now();
    put(element("camera"), status.camera);
    this.showNotices();
    this.showStop();
    this.showFollower();
    this.showDrive();
    this.showServices();
  }

  get stopped() {
    return Boolean(this.status?.stop.engaged || this.status?.follower?.estop);
  }

  showStop() {
    const pending = this.status.stop.pending_s !== null;
    const button = element("stop");
    button.toggleAttribute("data-stopped", this.stopped && !pending);
    button.toggleAttribute("data-pending", pending);
    put(button.firstElementChild, pending ? "STOPPING" : this.stopped ? "STOPPED" : "STOP");
    put(element("stop-note"), pending ? "waiting for the follower" : this.stopped ? "press resume to go on" : "or press Esc");
    const resume = element("resume");
    resume.hidden = !this.stopped;
    if (this.stopped && !this.wasStopped) {
      // A second tap meant for STOP must not resume.
      resume.disabled = true;
      setTimeout(() => { resume.disabled = false; }, RESUME_GUARD_MS);
    }
    this.wasStopped = this.stopped;
  }

  showNotices() {
    const wanted = this.status.notices.join("|");
    if (wanted === this.shownNotices) return;
    this.shownNotices = wanted;
    element("notices").replaceChildren(...this.status.notices.map((notice) => make("p", notice)));
  }

  showFollower() {
    const { follower, command, services } = this.status;
    const health = services.find((service) => service.service === "follower");
    const silent = health && health.silent_s > SILENT_SERVICE_S;
    const state = silent ? "silent" : follower?.state ?? "unknown";
    const pill = element("state");
    put(pill, state);
    pill.dataset.tone = silent ? "bad" : STATE_TONES[state] ?? "wait";
    const target = follower?.target;
    const named = target?.track_id ? `person ${target.track_id}` : target?.mode === "nearest" ? "nearest person" : "no target";
    put(element("target"), named);
    put(element("reason"), silent ? `no word for ${health.silent_s.toFixed(0)} s` : follower?.reason ?? "no follower has been heard yet");
    element("nearest").setAttribute("aria-pressed", String(target?.mode === "nearest"));
    element("none").setAttribute("aria-pressed", String(target?.mode === "none"));
    const old = !command || command.age_s > command.ttl_s;
    this.gauge("linear", command?.linear_mps, old, "m/s", 1);
    this.gauge("angular", command?.angular_radps, old, "rad/s", -1);
  }

  showDrive() {
    const { drive } = this.status;
    element("drive").hidden = !drive;
    if (!drive) return;
    const old = drive.age_s > SILENT_DRIVE_S;
    const pill = element("drive-state");
    put(pill, old ? "silent" : drive.state);
    pill.dataset.tone = old ? "bad" : DRIVE_TONES[drive.state];
    put(element("drive-reason"), old ? `no word for ${drive.age_s.toFixed(1)} s` : drive.reason);
    this.gauge("drive-linear", drive.linear_mps, old, "m/s", 1);
    this.gauge("drive-angular", drive.angular_radps, old, "rad/s", -1);
  }

  // Left on the bar is left for the robot, so a positive turn rate grows to the left.
  gauge(name, value, old, unit, direction) {
    const bar = element(`${name}-bar`);
    const row = bar.closest(".gauge");
    row.toggleAttribute("data-old", old);
    if (value === undefined || old) {
      put(element(name), old && value !== undefined ? "none" : "\u2013");
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
    const { services, web } = this.status;
    const rows = services.map((service) => {
      const silent = service.silent_s > SILENT_SERVICE_S;
      const tone = service.state === "ended" ? "off" : silent || service.state === "error" ? "bad"
        : service.state === "ok" ? "good" : "warn";
      const row = make("tr", "", { tone });
      const name = service.instance === "main" ? service.service : `${service.service} ${service.instance}`;
      const age = `${service.age_ms_p50.toFixed(0)} / ${service.age_ms_p95.toFixed(0)}`;
      const figures = service.state === "ended" ? ["ended", "", "", ""]
        : silent ? ["silent", "", `${service.silent_s.toFixed(0)} s`, ""]
          : [service.rate_in_hz.toFixed(0), service.rate_out_hz.toFixed(0), age, service.dropped];
      row.append(...[name, ...figures].map((text) => make("td", String(text))));
      return row;
    });
    element("services").replaceChildren(...rows);
    const complaints = services
      .filter((service) => service.reason && service.state !== "ended")
      .map((service) => make("li", `${service.service}: ${service.reason}`));
    const malformed = services.reduce((sum, service) => sum + service.malformed, 0);
    if (malformed) complaints.push(make("li", `${malformed} malformed messages refused`));
    if (web.unreadable) complaints.push(make("li", `${web.unreadable} pictures could not be read`));
    element("problems").replaceChildren(...complaints);
  }

  /** A frame was drawn. */
  showFrame(header, people) {
    this.drawn.push(performance.now());
    this.frameAge = header.age_ms;
    element("no-tracks").hidden = header.tracks !== null;
    put(element("viewer"), `this page: frame ${header.index + 1}, ${header.dropped} dropped for a slow viewer`);
    this.showPeople(people, header.target?.id);
  }

  showPeople(people, target) {
    const sorted = [...people].sort((one, other) => one.id - other.id);
    const wanted = sorted.map((person) => person.id).join() + `>${target}`;
    this.people = new Map(people.map((person) => [person.id, person]));
    if (wanted === this.shownPeople) return;
    this.shownPeople = wanted;
    const list = element("people");
    const focused = document.activeElement?.dataset.person;
    list.replaceChildren(...sorted.map((person) => {
      const button = make("button", String(person.id), { person: person.id });
      button.type = "button";
      button.style.setProperty("--person", colourOf(person.id));
      button.setAttribute("aria-pressed", String(person.id === target));
      button.setAttribute("aria-label", `follow person ${person.id}`);
      button.onclick = () => this.onPerson(person);
      return button;
    }));
    if (focused) list.querySelector(`[data-person="${focused}"]`)?.focus();
  }

  /** Called several times a second: ages grow even when nothing arrives. */
  tick(link) {
    const oldest = performance.now() - RATE_WINDOW_MS;
    this.drawn = this.drawn.filter((drawnAt) => drawnAt > oldest);
    const rate = (1000 * this.drawn.length) / RATE_WINDOW_MS;
    put(element("figures"), rate ? `${rate.toFixed(0)} fps \u00b7 ${this.frameAge.toFixed(0)} ms` : "");
    const banners = this.banners(link);
    const wanted = banners.map((banner) => banner.join()).join("|");
    if (wanted !== this.shownBanners) {
      this.shownBanners = wanted;
      element("banners").replaceChildren(...banners.map(([tone, text]) => make("p", text, { tone })));
    }
    const pill = element("link");
    put(pill, !link.connected ? "reconnecting" : this.stale ? "stale" : this.ended ? "ended" : "live");
    pill.dataset.tone = !link.connected ? "bad" : this.stale ? "warn" : this.ended ? "calm" : "good";
    element("stage").toggleAttribute("data-stale", !link.connected || this.stale);
  }

  banners(link) {
    const banners = [];
    this.stale = false;
    this.ended = Boolean(this.status?.picture.ended);
    if (this.unsentStop) banners.push(["bad", this.unsentStop]);
    if (!link.connected) {
      const seconds = Math.max(0, (link.retryAt - performance.now()) / 1000);
      banners.push(["bad", this.status ? `Connection to the web service lost: trying again${seconds >= 1 ? ` in ${Math.ceil(seconds)} s` : ""}` : "Connecting to the web service"]);
    }
    if (!this.status) return banners;
    const { stop, router, picture, camera } = this.status;
    const since = (performance.now() - this.statusAt) / 1000;
    if (stop.pending_s !== null && stop.pending_s + since > UNCONFIRMED_S) {
      banners.push(["bad", "STOP is being sent, but no follower has confirmed it: use the robot\u2019s own switch"]);
    }
    if (!router) banners.push(["bad", "The Zenoh router is away: nothing can be seen or sent until it is back"]);
    if (picture.ended) {
      banners.push(["calm", `The stream ended after ${picture.ended.frames} frames: ${picture.ended.reason}`]);
    } else if (picture.age_s === null) {
      banners.push(["calm", `Waiting for the first picture of camera \u201c${camera}\u201d`]);
    } else if (picture.age_s + since > picture.stale_after_s) {
      this.stale = true;
      banners.push(["warn", `No picture for ${(picture.age_s + since).toFixed(1)} s`]);
    }
    return banners;
  }

  toast(text, tone = "good") {
    const toast = element("toast");
    put(toast, text);
    toast.dataset.tone = tone;
    toast.hidden = false;
    clearTimeout(this.toastTimer);
    this.toastTimer = setTimeout(() => { toast.hidden = true; }, TOAST_MS);
  }
}
