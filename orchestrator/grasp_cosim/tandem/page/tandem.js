// A gripper whose fingers move in tandem: the beam that carries both, and the arm it hangs from.

const BEAM = 30, DEEP = 12, ARM = 26; // px: top and height of the beam, width of the arm

class Tandem extends Grasp {
  target(pen, x, t) { // the arm is where a grasp has its label
    this.wrist(pen, x, t);
    if (!this.plan.target) return;
    const at = x(this.at(this.plan.target, t));
    this.targetLine(pen, at, BEAM + DEEP);
    pen.textAlign = "left";
    pen.fillText("target", at + 6, FLOOR - 9);
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
