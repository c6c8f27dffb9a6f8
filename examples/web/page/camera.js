// The camera of the player: an orbit around a point, which eases to where it is moved.
// In: what is known of a capture, then movements and passing time. Out: the pose and the lens that the player draws with.

const HALF_FIELD_OF_VIEW = 0.35;
const STEEPEST = 1.5;
// Share of the way that remains after a second of easing, as an exponent.
const HASTE = 12;
// Units that a flight covers in a second, relative to the distance of the point.
const FLIGHT = 0.8;

const add = (a, b, factor = 1) => a.map((value, i) => value + factor * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, factor) => a.map((value) => value * factor);
const unit = (a) => scaled(a, 1 / Math.hypot(...a));
const within = (value, least, most) => Math.min(most, Math.max(least, value));
const copy = (state) => ({ ...state, target: [...state.target] });

// A unit vector at right angles to another: the one from which the angles of native orbits are counted.
function beside([x, y, z]) {
  const sign = z < 0 ? -1 : 1;
  const a = -1 / (sign + z);
  return [x * y * a, sign + y * y * a, -y];
}

export class Orbit {
  // `eased` is false where the user wants no motion.
  constructor(about, eased = true) {
    this.up = unit([...about.up]);
    this.eased = eased;
    this.surround(about);
    this.wanted = copy(this.first);
    this.now = copy(this.first);
    this.given = null;
  }

  // Sets the first camera, and how near and far others may be. The camera stays where it is.
  surround(about) {
    // The whole core is in view, as in native orbits; scenes of millimeters have no room for the near limit of others.
    const radius = about.radius > 0 ? about.radius : 1;
    this.limits = [radius * 0.01, Math.max(1e4, radius * 100)];
    const distance = radius < 0.1 ? radius / Math.sin(HALF_FIELD_OF_VIEW) + 2 * radius : radius / Math.sin(HALF_FIELD_OF_VIEW) + 0.2;
    this.first = { yaw: 0, pitch: 0.35, target: [...about.center], distance };
  }

  // Goes to where it is wanted, at once.
  jump() {
    this.now = copy(this.wanted);
  }

  // Lets time pass, with the directions in which the camera flies: right, down, forward. Returns whether the camera has moved.
  advance(seconds, flight = [0, 0, 0]) {
    if (flight.some(Boolean)) this.fly(scaled(flight, FLIGHT * seconds * this.wanted.distance));
    const { now, wanted } = this;
    const rest = [now.yaw - wanted.yaw, now.pitch - wanted.pitch, Math.log(now.distance / wanted.distance), ...add(now.target, wanted.target, -1).map((by) => by / wanted.distance)];
    const apart = Math.max(...rest.map(Math.abs));
    if (apart === 0) return false;
    const share = this.eased && apart > 1e-4 ? 1 - Math.exp(-HASTE * seconds) : 1;
    if (share === 1) this.jump();
    else {
      now.yaw += (wanted.yaw - now.yaw) * share;
      now.pitch += (wanted.pitch - now.pitch) * share;
      now.distance *= (wanted.distance / now.distance) ** share;
      now.target = add(now.target, add(wanted.target, now.target, -1), share);
    }
    return true;
  }

  // Returns whether it is where it is wanted.
  get settled() {
    return JSON.stringify(this.now) === JSON.stringify(this.wanted);
  }

  home() {
    this.given = null;
    this.wanted = copy(this.first);
  }

  // Takes a camera of the page around this one: a pose of sixteen numbers, and perhaps a lens of two or four. Returns whether it is one.
  give({ pose, lens = null }) {
    const are = (numbers, counts) => Array.isArray(numbers) && counts.includes(numbers.length) && numbers.every(Number.isFinite);
    if (!are(pose, [16]) || (lens && !are(lens, [2, 4]))) return false;
    this.given = { pose: Float32Array.from(pose), lens: lens && Float32Array.from(lens) };
    return true;
  }

  turn(yaw, pitch) {
    this.given = null;
    this.wanted.yaw += yaw;
    this.wanted.pitch = within(this.wanted.pitch + pitch, -STEEPEST, STEEPEST);
  }

  // Turns around the camera itself: the point moves.
  look(yaw, pitch) {
    const eye = (axes) => add(this.wanted.target, axes.outward, this.wanted.distance);
    const before = eye(this.axes(this.wanted));
    this.turn(yaw, pitch);
    this.wanted.target = add(this.wanted.target, add(before, eye(this.axes(this.wanted)), -1));
  }

  // Multiplies the distance. Returns whether that changes it.
  zoom(factor) {
    const before = this.wanted.distance;
    this.given = null;
    this.wanted.distance = within(before * factor, ...this.limits);
    return this.wanted.distance !== before;
  }

  // Moves the point, in heights of the picture.
  pan(right, down) {
    const height = 2 * Math.tan(HALF_FIELD_OF_VIEW) * this.wanted.distance;
    this.fly([right * height, down * height, 0]);
  }

  // Moves the camera and its point right, down and forward, units of the capture.
  fly([right, down, forward]) {
    this.given = null;
    const axes = this.axes(this.wanted);
    this.wanted.target = add(add(add(this.wanted.target, axes.side, right), axes.below, down), axes.forward, forward);
  }

  axes({ yaw, pitch }) {
    const side = beside(this.up);
    const front = cross(this.up, side);
    const flat = add(scaled(side, Math.cos(yaw)), front, Math.sin(yaw));
    const outward = add(scaled(flat, Math.cos(pitch)), this.up, Math.sin(pitch));
    const forward = scaled(outward, -1);
    const right = unit(cross(forward, this.up));
    return { outward, forward, side: right, below: cross(forward, right) };
  }

  // The matrix from the capture to the camera, column by column: x right, y down, z forward.
  pose() {
    if (this.given) return this.given.pose;
    const { outward, forward, side, below } = this.axes(this.now);
    const eye = add(this.now.target, outward, this.now.distance);
    const rows = [side, below, forward];
    return Float32Array.from([0, 1, 2].flatMap((i) => [...rows.map((row) => row[i]), 0]).concat(rows.map((row) => -dot(row, eye)), 1));
  }

  // Tangents of half the field of view across and down.
  lens(width, height) {
    if (this.given?.lens) return this.given.lens;
    const tan = Math.tan(HALF_FIELD_OF_VIEW);
    const aspect = width / height;
    return Float32Array.from(aspect > 1 ? [tan * aspect, tan] : [tan, tan / aspect]);
  }

  // The camera as text for a link; and back.
  text() {
    const { yaw, pitch, distance, target } = this.wanted;
    return [yaw, pitch, distance, ...target].map((value) => +value.toPrecision(6)).join(',');
  }

  read(text) {
    const numbers = String(text).split(',').map(Number);
    if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return false;
    const [yaw, pitch, distance, ...target] = numbers;
    this.given = null;
    this.wanted = { yaw, pitch: within(pitch, -STEEPEST, STEEPEST), distance: within(distance, ...this.limits), target };
    this.jump();
    return true;
  }
}
