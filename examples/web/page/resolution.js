// The resolution that a device has time for.
// In: how long pictures take. Out: the share of the full side length that the next picture is drawn with, up to 1: less while something moves and
// pictures are slow, more when it rests.

// Milliseconds of a picture while something moves: slower ones are made smaller, quicker ones larger.
const SLOW = 90;
const AIM = 55;
const QUICK = 25;
// Milliseconds that a picture of what rests may take, by what the last one took.
const PATIENT = 2500;
// Quick pictures in a row before the next is larger; and how much longer after a size that was too large.
const ROW = 8;

export class Resolution {
  // `first` is the share of the first picture, `least` the smallest one.
  constructor(first = 1, least = 0.1) {
    this.least = Math.min(1, least);
    this.moving = Math.max(first, this.least);
    this.still = this.moving;
    this.quick = 0;
    this.row = ROW;
  }

  // The share to draw with.
  share(moves) {
    return moves ? this.moving : this.still;
  }

  // Learns from a picture that was drawn with a share.
  learn(milliseconds, share, moved) {
    if (moved) {
      if (milliseconds > SLOW && share <= this.moving) {
        this.moving = Math.max(this.least, share * Math.min(0.9, Math.max(0.3, Math.sqrt(AIM / milliseconds))));
        this.row = Math.min(240, this.row * 2);
        this.quick = 0;
      } else if (milliseconds < QUICK && this.moving < 1) {
        this.quick += 1;
        if (this.quick >= this.row) [this.moving, this.quick] = [Math.min(1, this.moving * 1.2), 0];
      } else this.quick = 0;
      this.still = this.moving;
    } else if (share >= this.still) {
      // The time of a picture grows with its area at most.
      const most = Math.sqrt(PATIENT / Math.max(milliseconds, 1));
      this.still = Math.min(1, share * Math.max(1, Math.min(2, most)));
    }
  }

  // Whether what rests can be drawn sharper than with a share.
  sharper(share) {
    return this.still > share;
  }
}
