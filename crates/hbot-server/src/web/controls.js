// The controls of the scene's effects, drawn from the schemas that the server gives.

import { put } from './state.js';
import { roundUp } from './plot.js';
import { PUSHES } from './rig.js';
import { converted, explain, fits, heads, mayBeAbsent, shape } from './schema.js';

/** The slider of a stiffness reaches the rig's torque limit at this deflection, rad. */
const STIFFEST_AT = 0.1;
/** The largest damping on a slider for each N m/rad of the largest stiffness, s. */
const DAMPING_SHARE = 0.02;
/** A slider is logarithmic if the largest legal value is more than this many times the least. */
const FAR = 100;
/** The least value above 0 on such a slider if 0 is legal: this part of the default, or this value. */
const [LEAST_PART, LEAST] = [0.1, 0.001];
/** Units of what an effect is about, the most important first: it pushes at rest, or brakes. */
const MAIN = [PUSHES, /^N m/];
/** Steps from one end of a slider to the other. */
const STEPS = 400;

function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key in element && key !== 'list') element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

/**
 * Returns a logarithmic scale: the places of a slider, 0 to STEPS, stand for values up to `end`. With
 * `zero`, the first place is 0 and the second is `least`.
 */
function logarithmic(least, end, zero) {
  const first = zero ? 1 : 0;
  const steps = STEPS - first;
  return {
    place: (x) => (x <= 0 ? 0 : first + (steps * Math.log(Math.max(1, x / least))) / Math.log(end / least)),
    value: (place) => (place < first ? 0 : +(least * (end / least) ** ((place - first) / steps)).toPrecision(3)),
  };
}

/** Returns the name of a parameter in words, with its unit. The key itself is in its title. */
function named(key, schema) {
  const { unit } = schema;
  const ending = `_${unit}`;
  const words = (key.endsWith(ending) ? key.slice(0, -ending.length) : key).replaceAll('_', ' ');
  const label = make('span', { className: 'key', title: `${key}: ${explain(schema)}` }, words);
  if (unit && unit !== '1') label.append(', ', make('small', {}, unit));
  return label;
}

/** Returns a number as it stands in a field: six digits, without a tail of zeros. */
const plain = (x) => `${+x.toPrecision(6)}`;

/** A slider is taken where a press is this near to the middle of its handle, px. */
const GRIP = 24;
/** Keys that would move a slider far up at once, as Home moves one that goes below 0. */
const LEAPS = new Set(['End', 'PageUp']);

/** Returns a number with two digits, rounded down, as the server's warnings have it. */
function roundedDown(x) {
  if (!(x > 0)) return '0';
  const unit = 10 ** (Math.floor(Math.log10(x)) - 1);
  return `${+(Math.floor(x / unit + 1e-9) * unit).toPrecision(2)}`;
}

/** Describes the types in a value. Two values of one description share their controls. */
const form = (value) => (Array.isArray(value) ? `[${value.map(form)}]`
  : value === null ? '0' : typeof value === 'object' ? `{${Object.values(value).map(form)}}` : typeof value);

export class Controls {
  /** `set(effect, key, value)` asks for a value, and returns the promise of its answer. */
  constructor(root, rig, set) {
    Object.assign(this, { root, rig, ask: set, built: '', updates: [] });
    this.next = new Map();
  }

  /** Draws the effects of the running scene, with new controls if their form has changed. */
  show() {
    const effects = this.rig.info?.scene?.effect ?? [];
    const key = JSON.stringify(effects.map((effect) => [effect.id, effect.kind,
      Object.keys(effect).map((key) => form(this.rig.value(effect, key)))]));
    if (key !== this.built) {
      const opened = new Set([...this.root.querySelectorAll('details[open]')].map((it) => it.dataset.id));
      // Another scene, and not another form of a value.
      const ids = effects.map(({ id }) => id).join('\n');
      const another = ids !== this.ids;
      [this.built, this.ids] = [key, ids];
      this.updates = [];
      const parts = effects.map((effect, k) => this.effect(effect.id, k,
        opened.has(effect.id) || (another && k === 0)));
      this.root.replaceChildren(...parts);
    }
    for (const update of this.updates) update();
  }

  effect(id, k, open) {
    const of = () => this.rig.info.scene.effect[k] ?? {};
    const kind = this.rig.kind(of().kind);
    const summary = make('summary', { title: kind?.description ?? '' },
      make('strong', {}, id), make('span', { className: 'weak' }, of().kind === id ? '' : ` ${of().kind}`));
    // What it is about, for when it is folded.
    const about = make('span', { className: 'main' });
    summary.append(about);
    const [[key, { unit }] = ['', {}]] = MAIN.flatMap((units) => (
      Object.entries(kind?.schema.properties ?? {}).filter(([, { unit = '' }]) => units.test(unit))));
    this.updates.push(() => {
      const x = this.rig.value(of(), key);
      put(about, typeof x === 'number' ? `${plain(x)} ${unit}` : x ? `${key.replaceAll('_', ' ')}: ${Array.isArray(x[0]) ? 'matrix' : 'list'}` : '');
    });
    const box = make('details', { open }, summary);
    box.dataset.id = id;
    if (!kind) {
      box.append(make('p', { className: 'weak' }, 'The server has told no parameters of this kind.'));
      return box;
    }
    for (const [key, schema] of Object.entries(kind.schema.properties ?? {})) {
      const get = () => this.rig.value(of(), key) ?? schema.default ?? null;
      const set = (value) => this.want(id, key, value);
      const row = make('div', { className: 'parameter' }, named(key, schema));
      const reach = this.reach(key);
      const border = key === 'stiffness' ? () => this.border(of()) : null;
      row.append(this.edit(`${id} ${key}`, schema, get, set, { reach, border }));
      box.append(row);
      if (border) box.append(this.stability(of, get));
    }
    return box;
  }

  /** Returns the end of the slider of a stiffness or damping, or null for other parameters. */
  reach(key) {
    const { limits, render } = this.rig.info;
    const torque = limits.torque > 0 ? limits.torque / STIFFEST_AT : 10;
    const stiffest = roundUp(Math.max(torque, 1.5 * (render?.stiffness_stable ?? 0)));
    return { stiffness: stiffest, damping: stiffest * DAMPING_SHARE }[key] ?? null;
  }

  /**
   * Returns the stiffness up to which the loop keeps the scene stable, as the server has computed
   * it; of the axis that allows least if it is a matrix. Null if it is not known.
   */
  border(effect) {
    const found = this.rig.stable.filter(({ effect: id }) => id === effect.id).map(({ stiffness }) => stiffness);
    return found.length > 0 ? Math.min(...found) : null;
  }

  stability(of, get) {
    const text = make('p', { className: 'weak' });
    this.updates.push(() => {
      const border = this.border(of());
      text.hidden = border === null;
      if (border === null) return;
      const warned = this.rig.warnings.some(({ effect }) => effect === of().id);
      text.className = warned || get() > border ? 'warn' : 'weak';
      // The border of one is that with what the others have now.
      const others = this.rig.stable.length - 1;
      const up = `stable up to ${roundedDown(border)} N m/rad`;
      put(text, others > 0 ? `Expected ${up}, the other${others > 1 ? 's' : ''} as set` : `Expected to be ${up} (mark)`);
    });
    return text;
  }

  /** Notes a wish and sends it. While one is on its way, the newest waits for its answer. */
  want(id, key, value) {
    const place = `${id} ${key}`;
    this.rig.wishes.set(place, value);
    if (this.next.has(place)) this.next.set(place, { value });
    else {
      this.next.set(place, null);
      this.send(id, key, value);
    }
    this.show();
  }

  async send(id, key, value) {
    const place = `${id} ${key}`;
    const done = await this.ask(id, key, value);
    const next = this.next.get(place);
    if (next) {
      this.next.set(place, null);
      this.send(id, key, next.value);
      return;
    }
    this.next.delete(place);
    const effect = this.rig.info?.scene.effect.find((effect) => effect.id === id);
    if (done && effect) effect[key] = value;
    this.rig.wishes.delete(place);
    this.show();
  }

  /** Makes the control of a value. `get` returns it and `set` asks for another. */
  edit(name, schema, get, set, more = {}) {
    if (!mayBeAbsent(schema)) return this.present(name, schema, get, set, more);
    const button = (text, value) => make('button', {
      type: 'button', className: 'small', 'aria-label': `${name}: ${text}`, onclick: () => set(value()) }, text);
    if (get() === null) return button('set', () => converted(schema, null));
    return make('div', { className: 'optional' },
      this.present(name, schema, get, set, more), button('none', () => null));
  }

  present(name, schema, get, set, more) {
    const s = shape(schema);
    switch (s.kind) {
      case 'number': return this.number(name, schema, s, get, set, more);
      case 'flag': {
        const box = make('input', { type: 'checkbox', 'aria-label': name, onchange: () => set(box.checked) });
        this.updates.push(() => { box.checked = Boolean(get()); });
        // A finger may also hit the ground around it.
        return make('label', { className: 'flag' }, box);
      }
      case 'choice': {
        const text = (value) => (typeof value === 'string' ? value : JSON.stringify(value));
        const select = make('select', {
          'aria-label': name, title: explain(schema), onchange: () => set(s.values[select.selectedIndex]) },
        ...s.values.map((value) => make('option', {}, text(value))));
        this.updates.push(() => { select.selectedIndex = s.values.indexOf(get()); });
        return select;
      }
      case 'list': return this.list(name, s, get, set, { ...more, named: heads(schema) });
      case 'group': return make('div', { className: 'group' },
        ...Object.entries(s.properties).map(([key, part]) => make('div', { className: 'parameter' },
          named(key, part),
          this.edit(`${name} ${key}`, part, () => get()?.[key] ?? null,
            (value) => set({ ...get(), [key]: value })))));
      case 'variants': return this.variants(
        name, s.variants, get, set, { ...more, standard: schema.default });
      case 'text': {
        const field = make('input', { 'aria-label': name, onchange: () => set(field.value) });
        this.updates.push(() => { if (document.activeElement !== field) field.value = get() ?? ''; });
        return field;
      }
      default: return make('span', { className: 'weak' }, JSON.stringify(get()));
    }
  }

  number(name, schema, s, get, set, { reach, border, bare, standard = schema.default } = {}) {
    const unit = schema.unit ?? '';
    const field = make('input', {
      type: 'number', step: s.whole ? 1 : 'any', 'aria-label': bare ? name : `${name} value${unit && `, ${unit}`}`,
      // The wheel scrolls, and changes no number. What is half typed is dropped.
      onwheel: () => {
        if (document.activeElement !== field) return;
        field.value = plain(get() ?? 0);
        field.blur();
      },
      title: explain(schema) });
    if (Number.isFinite(s.least)) field.min = s.least;
    if (Number.isFinite(s.most)) field.max = s.most;
    // A rig must not get the 1 while the person types 15.
    field.onchange = () => {
      const { rangeUnderflow, rangeOverflow } = field.validity;
      if (rangeUnderflow || rangeOverflow) field.reportValidity();
      else if (field.value !== '' && Number.isFinite(+field.value)) set(s.whole ? Math.round(field.value) : +field.value);
    };
    field.onblur = () => { field.value = plain(get() ?? 0); };
    const update = (slider) => {
      const x = get();
      if (typeof x !== 'number') return;
      if (document.activeElement !== field) field.value = plain(x);
      if (slider) slider.value = scale.place(x);
    };
    if (bare) {
      this.updates.push(() => update());
      return field;
    }
    const given = typeof standard === 'number' ? Math.abs(standard) : 0;
    const usual = Math.max(Math.abs(get() ?? 0), given);
    const least = s.least > 0 ? s.least : LEAST_PART * given || LEAST;
    // Numbers from 0 count something.
    const far = s.least >= 0 && !(s.whole && s.least === 0) && Math.round(s.most / least) > FAR;
    let end = Math.min(s.most, Math.max(
      reach ?? roundUp((far ? 20 : 2) * usual || 1), get() ?? 0, far ? FAR * least : 0));
    const start = Math.max(s.least, s.least < 0 ? -end : 0);
    const slider = make('input', { type: 'range', min: far ? 0 : start, max: far ? STEPS : end,
      step: far || s.whole ? 1 : (end - start) / STEPS, 'aria-label': name });
    const linear = { place: (x) => x, value: (place) => +place.toPrecision(6) };
    let scale = far ? logarithmic(least, end, s.least === 0) : linear;
    // Several places can stand for one whole number. A key moves by one place, and must not stay.
    let byKey = false;
    slider.onkeydown = (event) => {
      [byKey, beside] = [true, false];
      if (LEAPS.has(event.key) || (event.key === 'Home' && s.least < 0)) event.preventDefault();
    };
    // A press beside the handle, as of a finger that scrolls, changes nothing. Nor does a drag that becomes a scroll.
    let [beside, taken] = [false, null];
    slider.onpointerdown = (event) => {
      const { left, width } = slider.getBoundingClientRect();
      const share = (slider.value - slider.min) / (slider.max - slider.min);
      const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
      const handle = left + 0.5 * rem + share * (width - rem);
      [byKey, beside, taken] = [false, Math.abs(event.clientX - handle) > GRIP, get()];
    };
    slider.onpointercancel = () => {
      if (!beside && taken !== null && get() !== taken) set(taken);
      beside = false;
    };
    slider.oninput = () => {
      if (beside) return update(slider);
      const [x, old] = [scale.value(+slider.value), get()];
      if (!s.whole) return set(x);
      const moved = slider.value - scale.place(old);
      const stays = byKey && Math.round(x) === old && Math.abs(moved) < 2;
      return set(stays ? old + Math.sign(moved) : Math.round(x));
    };
    const mark = make('div', { className: 'mark', hidden: true });
    this.updates.push(() => {
      if (get() > end) {
        end = get();
        if (far) scale = logarithmic(least, end, s.least === 0);
        else slider.max = end;
      }
      update(slider);
      slider.setAttribute('aria-valuetext', `${plain(get() ?? 0)} ${unit}`.trim());
      if (!border) return;
      const share = typeof border() === 'number' ? scale.place(border()) / slider.max : 1;
      mark.hidden = !(share < 1);
      field.classList.toggle('over', share < 1 && get() > border());
      mark.dataset.at = mark.hidden ? '' : roundedDown(border());
      // The handle stays half its width of 1 rem away from the ends.
      mark.style.left = `calc(0.5rem + ${share} * (100% - 1rem))`;
    });
    return make('div', { className: 'number' }, make('div', { className: 'slider' }, slider, ...(border ? [mark] : [])), field);
  }

  list(name, s, get, set, { reach, border, named } = {}) {
    const parts = get() ?? [];
    const nested = ['list', 'group'].includes(shape(s.item).kind);
    const put = (k, part) => set(get().map((old, i) => (i === k ? part : old)));
    const box = make('div', { className: nested ? 'rows' : 'cells' }, ...parts.map((_, k) => this.edit(
      `${name} ${k + 1}`, s.item, () => get()?.[k] ?? null, (part) => put(k, part), { bare: true, reach, border })));
    if (named.length > 0 && named.length === (nested ? parts[0]?.length : parts.length)) {
      const row = make('div', { className: 'cells heads' }, ...named.map((head) => make('span', {}, head)));
      // A list of lists has it once, above all rows.
      if (nested) box.prepend(row);
      else return make('div', { className: 'rows' }, row, box);
    }
    if (s.least !== s.most) {
      const button = (text, label, enabled, act) => make('button', {
        type: 'button', className: 'small', 'aria-label': `${name}: ${label}`, disabled: !enabled, onclick: act }, text);
      const buttons = [
        button('+', 'one more', parts.length < s.most, () => set([...get(), get().at(-1) ?? converted(s.item, null)])),
        button('\u2212', 'one fewer', parts.length > s.least, () => set(get().slice(0, -1)))];
      // In a line of its own below the rows, or else behind the numbers.
      box.append(...(nested ? [make('div', { className: 'count' }, ...buttons)] : buttons));
    }
    return box;
  }

  variants(name, variants, get, set, more) {
    const present = variants.findIndex((variant) => fits(variant, get()));
    const title = (variant) => {
      const s = shape(variant);
      if (s.kind === 'list') return shape(s.item).kind === 'list' ? 'matrix' : 'list';
      return { number: 'number', choice: 'choice', null: 'none' }[s.kind] ?? 'other';
    };
    const select = make('select', {
      className: 'form', title: 'one number for all directions, or a matrix', 'aria-label': `${name}: form`, onchange: () => set(converted(variants[select.selectedIndex], get())) },
    ...variants.map((variant) => make('option', {}, title(variant))));
    this.updates.push(() => { select.selectedIndex = present; });
    const control = present < 0 ? make('span', { className: 'weak' }, JSON.stringify(get()))
      : this.edit(name, variants[present], get, set, more);
    return make('div', { className: 'variants' }, control, select);
  }
}
