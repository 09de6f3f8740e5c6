// A gripper whose fingers move in tandem: the beam that carries both, and the arm it hangs from.

const BEAM = 30, DEEP = 12, ARM = 26; // px: top and height of the beam, width of the arm

class Tandem extends Grasp {
  axis(pen, x, width, scale) {
    super.axis(pen, x, width, scale);
    this.x = x; // of this drawing
  }

  target(pen, x, t) {
    this.wrist(pen, x, t);
    super.target(pen, x, t);
  }

  wrist(pen, x, t) {
    const at = x(this.at(this.plan.wrist, t));
    const [right, left] = [1, 2].map((j) => x(this.at(this.plan.position[j], t)));
    pen.fillStyle = color("--muted");
    pen.fillRect(left - THICK, BEAM, right - left + 2 * THICK, DEEP);
    pen.fillRect(at - ARM / 2, 0, ARM, BEAM);
    this.canvas.dataset.wrist = at;
  }
}

Picture = Tandem;
