// The camera of the player: an orbit around a point.
// In: what is known of a capture, then movements. Out: the pose and the lens that the player draws with.

const HALF_FIELD_OF_VIEW = 0.35;
const STEEPEST = 1.5;

const add = (a, b, factor = 1) => a.map((value, i) => value + factor * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, factor) => a.map((value) => value * factor);
const unit = (a) => scaled(a, 1 / Math.hypot(...a));

// A unit vector at right angles to another: the one from which the angles of native orbits are counted.
function beside([x, y, z]) {
  const sign = z < 0 ? -1 : 1;
  const a = -1 / (sign + z);
  return [x * y * a, sign + y * y * a, -y];
}

export class Orbit {
  constructor(about) {
    this.up = unit([...about.up]);
    this.first = { yaw: 0, pitch: 0.35, target: [...about.center], distance: Math.max(about.radius, 0.1) / Math.sin(HALF_FIELD_OF_VIEW) + 0.2 };
    this.home();
  }

  home() {
    Object.assign(this, { ...this.first, target: [...this.first.target], given: null });
  }

  // Takes a camera of the page around this one: a pose of sixteen numbers, and perhaps a lens of two or four. Other values are ignored.
  give({ pose, lens = null }) {
    const are = (numbers, counts) => Array.isArray(numbers) && counts.includes(numbers.length) && numbers.every(Number.isFinite);
    if (!are(pose, [16]) || (lens && !are(lens, [2, 4]))) return;
    this.given = { pose: Float32Array.from(pose), lens: lens && Float32Array.from(lens) };
  }

  turn(yaw, pitch) {
    this.given = null;
    this.yaw += yaw;
    this.pitch = Math.min(STEEPEST, Math.max(-STEEPEST, this.pitch + pitch));
  }

  // Multiplies the distance.
  zoom(factor) {
    this.given = null;
    this.distance = Math.min(1e4, Math.max(0.05, this.distance * factor));
  }

  // Moves the point, in heights of the picture.
  pan(right, down) {
    this.given = null;
    const { side, below } = this.axes();
    const height = 2 * Math.tan(HALF_FIELD_OF_VIEW) * this.distance;
    this.target = add(add(this.target, side, right * height), below, down * height);
  }

  axes() {
    const side = beside(this.up);
    const front = cross(this.up, side);
    const flat = add(scaled(side, Math.cos(this.yaw)), front, Math.sin(this.yaw));
    const outward = add(scaled(flat, Math.cos(this.pitch)), this.up, Math.sin(this.pitch));
    const forward = scaled(outward, -1);
    const right = unit(cross(forward, this.up));
    return { outward, forward, side: right, below: cross(forward, right) };
  }

  // The matrix from the capture to the camera, column by column: x right, y down, z forward.
  pose() {
    if (this.given) return this.given.pose;
    const { outward, forward, side, below } = this.axes();
    const eye = add(this.target, outward, this.distance);
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
    return [this.yaw, this.pitch, this.distance, ...this.target].map((value) => +value.toFixed(4)).join(',');
  }

  read(text) {
    const numbers = String(text).split(',').map(Number);
    if (numbers.length !== 6 || !numbers.every(Number.isFinite)) return false;
    const [yaw, pitch, distance, ...target] = numbers;
    Object.assign(this, { yaw, target, given: null });
    this.pitch = Math.min(STEEPEST, Math.max(-STEEPEST, pitch));
    this.distance = Math.min(1e4, Math.max(0.05, distance));
    return true;
  }
}
