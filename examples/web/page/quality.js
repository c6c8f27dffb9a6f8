// The resolution, and the share of the Gaussians, that a device has time for.
// In: how long pictures take, looked at once a frame. Out: the share of the full side length that the next picture is drawn with, up to 1, and the
// share of the Gaussians: less while something moves and pictures are slow, more when it rests. At rest all Gaussians are drawn.

// The factor by which a picture gets wider and higher again.
const LARGER = 1.2;
// Milliseconds of a picture while something moves: slower ones are made smaller, quicker ones larger. A picture that is there at the next frame is
// quick, too, if a larger one would not take longer than wanted: a browser that saves power shows a frame in 33 ms.
const SLOW = 90;
const AIM = 55;
const QUICK = 25;
const QUICK_FRAME = AIM / LARGER ** 2;
// Milliseconds that a picture of what rests may take, by what the last one took.
const PATIENT = 2500;
// Quick pictures in a row before the next is larger; and how much longer after a size that was too large.
const ROW = 8;
// The smallest share of the Gaussians, and the smallest factor on it and on the side length from picture to picture.
const FEWEST = 0.1;
const STEP = 0.3;

export class Quality {
  // `first` is the share of the side length of the first picture, `least` the smallest one.
  constructor(first = 1, least = 0.1) {
    this.least = least;
    this.moving = Math.max(first, this.least);
    this.still = this.moving;
    this.kept = 1;
    this.quick = 0;
    this.row = ROW;
  }

  // The share of the side length to draw with.
  share(moves) {
    return moves ? this.moving : this.still;
  }

  // The share of the Gaussians to draw.
  gaussians(moves) {
    return moves ? this.kept : 1;
  }

  // Learns from a picture that was drawn with a share. `frame` is the time since the frame before, milliseconds.
  learn(milliseconds, share, moved, frame) {
    if (moved) {
      const isQuick = milliseconds <= Math.max(QUICK, Math.min(QUICK_FRAME, frame));
      if (milliseconds > SLOW && share <= this.moving) this.reduce(milliseconds, share);
      else if (isQuick && (this.kept < 1 || this.moving < 1)) this.restore();
      else this.quick = 0;
      this.still = this.moving;
    } else if (share >= this.still) {
      // The time of a picture grows with its area at most.
      const most = Math.sqrt(PATIENT / Math.max(milliseconds, 1));
      this.still = Math.min(1, share * Math.max(1, Math.min(2, most)));
    }
  }

  // Makes the next picture smaller; once it is as small as possible, leaves out Gaussians.
  reduce(milliseconds, share) {
    const wanted = AIM / milliseconds;
    this.moving = Math.max(this.least, share * Math.min(0.9, Math.max(STEP, Math.sqrt(wanted))));
    if (this.moving === this.least) {
      const left = wanted * (share / this.least) ** 2;
      this.kept = Math.max(FEWEST, this.kept * Math.min(1, Math.max(STEP, left)));
    }
    this.row = Math.min(240, this.row * 2);
    this.quick = 0;
  }

  // After enough quick pictures draws more Gaussians; once it is all of them, a larger picture.
  restore() {
    this.quick += 1;
    if (this.quick < this.row) return;
    this.quick = 0;
    if (this.kept < 1) this.kept = Math.min(1, this.kept * LARGER);
    else this.moving = Math.min(1, this.moving * LARGER);
  }

  // Whether what rests can be drawn better than a picture.
  sharper(drawn) {
    return this.still > drawn.share || drawn.gaussians < 1 || (drawn.moves && drawn.share < 1);
  }
}
