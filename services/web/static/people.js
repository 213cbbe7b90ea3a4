// The buttons of the people in sight. A button never moves, so that no finger meets somebody else.

import { colourOf } from "./picture.js";

const KEPT_MS = 3000;
const FRESH_MS = 700;
const MOST = 64;

export class People {
  /**
   * @param {HTMLElement} list what holds the buttons
   * @param {(person: object) => void} onPerson called when a person's button is pressed
   */
  constructor(list, onPerson) {
    this.list = list;
    this.onPerson = onPerson;
    // In the order in which they were first seen. Whoever leaves keeps the place for a while; then
    // somebody new may get it, but nobody is moved.
    this.slots = [];
    this.tracker = null;
  }

  show(people, target, tracker) {
    const now = performance.now();
    if (tracker && tracker !== this.tracker) {
      // Other ids from here on: 7 is not that 7 any more.
      for (const slot of this.slots) this.empty(slot, now);
      this.tracker = tracker;
    }
    const present = new Map(people.map((person) => [person.id, person]));
    for (const slot of this.slots) {
      const person = present.get(slot.id);
      if (person) {
        slot.person = { ...person, tracker: this.tracker };
        slot.leftAt = null;
        present.delete(slot.id);
      } else if (slot.leftAt === null) {
        slot.person = null;
        slot.leftAt = now;
      }
    }
    for (const person of [...present.values()].sort((one, other) => one.id - other.id)) this.add(person, now);
    for (const slot of this.slots) {
      slot.button.disabled = slot.person === null;
      const pressed = String(slot.id !== null && slot.id === target);
      if (slot.button.getAttribute("aria-pressed") !== pressed) slot.button.setAttribute("aria-pressed", pressed);
    }
  }

  /** Called several times a second: empty places at the end go, where nothing can move. */
  tick() {
    const now = performance.now();
    while (this.slots.length && this.isFree(this.slots[this.slots.length - 1], now)) {
      this.slots.pop().button.remove();
    }
  }

  isFree(slot, now) {
    return slot.person === null && now - slot.leftAt > KEPT_MS;
  }

  empty(slot, now) {
    slot.id = null;
    slot.person = null;
    slot.leftAt = now;
    slot.button.textContent = "";
    delete slot.button.dataset.person;
  }

  add(person, now) {
    let slot = this.slots.find((one) => this.isFree(one, now));
    if (!slot && this.slots.length >= MOST) return;
    if (slot) {
      slot.takenAt = now;
    } else {
      slot = { button: document.createElement("button"), takenAt: -Infinity };
      slot.button.type = "button";
      slot.button.onclick = () => this.press(slot);
      this.slots.push(slot);
      this.list.append(slot.button);
    }
    Object.assign(slot, { id: person.id, person: { ...person, tracker: this.tracker }, leftAt: null });
    const { button } = slot;
    button.textContent = person.id;
    button.dataset.person = person.id;
    button.style.setProperty("--person", colourOf(person.id));
    button.setAttribute("aria-label", `follow person ${person.id}`);
  }

  press(slot) {
    // A finger on its way to whoever was here before must not choose whoever has just come.
    if (slot.person === null || performance.now() - slot.takenAt < FRESH_MS) return;
    this.onPerson(slot.person);
  }
}
