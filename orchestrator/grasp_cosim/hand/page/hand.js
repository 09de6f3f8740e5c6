// A hand and the object at one moment, seen from above: x to the right, y up, the wrist at the origin.

const LONG = 46, WIDE = 22; // px of a finger

class Hand extends Grasp {
  constructor(recording, plan, series) {
    super(recording, plan, series);
    this.fingers = Object.keys(plan.position).map(Number);
    this.far = Math.max(1e-6, Math.abs(this.low), Math.abs(this.high));
  }

  draw(t, speed) {
    const { pen, width, height } = fitted(this.canvas), plan = this.plan;
    const middle = [width / 2, height / 2], room = LONG + 14;
    const scale = (Math.min(width, height) / 2 - room) / this.far;
    const at = ([x, y]) => [middle[0] + scale * x, middle[1] - scale * y];
    this.reach = Math.min(70, height / 6);
    this.rays(pen, at, scale, width, height);
    const faces = this.fingers.map((j, i) => {
      const e = [Math.cos(plan.angles[i]), Math.sin(plan.angles[i])];
      const s = this.at(plan.position[j], t), gap = this.at(plan.gap[j], t);
      return { j, e, s, gap, turn: plan.angles[i] };
    });
    const [x, y, turned] = plan.where.map((name) => this.at(name, t));
    this.object(pen, at, scale, faces, [x, y], turned);
    for (const face of faces) {
      const { j, e, s, gap } = face;
      const glow = this.glow(j, t, speed);
      if (glow > 0) shine(pen, ...at([(s - gap) * e[0], (s - gap) * e[1]]), 50, glow);
      this.fingerOn(pen, at([s * e[0], s * e[1]]), face);
    }
    for (const { j, e, s } of faces) {
      const tip = at([s * e[0], s * e[1]]), side = [e[1] * 8, e[0] * 8]; // next to the finger
      if (plan.actuator[j]) {
        this.force(pen, [tip[0] + LONG * e[0], tip[1] - LONG * e[1]], e,
          this.at(plan.actuator[j], t), `--finger${j}`, true);
      }
      this.force(pen, [tip[0] - side[0], tip[1] - side[1]], e, this.at(plan.contact_force[j], t), "--ink");
      this.canvas.dataset[`finger${j}`] = s;
    }
    this.canvas.dataset.scale = scale;
    this.canvas.dataset.glow = this.fingers.map((j) => this.glow(j, t, speed).toFixed(3));
    this.readings(t);
  }

  rays(pen, at, scale, width, height) {
    pen.strokeStyle = color("--rule");
    pen.lineWidth = 1;
    pen.beginPath();
    for (const angle of this.plan.angles) {
      pen.moveTo(...at([0, 0]));
      pen.lineTo(...at([1.6 * this.far * Math.cos(angle), 1.6 * this.far * Math.sin(angle)]));
    }
    pen.stroke();
    const long = [10, 20, 50, 100, 200, 500, 1000].find((mm) => 1e-3 * mm * scale > 40) ?? 1000;
    const left = 12, low = height - 16, right = left + 1e-3 * long * scale;
    pen.strokeStyle = pen.fillStyle = color("--muted");
    pen.beginPath();
    pen.moveTo(left, low - 4);
    pen.lineTo(left, low);
    pen.lineTo(right, low);
    pen.lineTo(right, low - 4);
    pen.stroke();
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillText(`${long} mm`, right + 6, low - 3);
  }

  // A disc, or what the faces under the fingers leave of a large square.
  object(pen, at, scale, faces, centre, turned) {
    pen.fillStyle = color("--object");
    pen.beginPath();
    const on = ({ e, s, gap }) => [(s - gap) * e[0], (s - gap) * e[1]];
    if (this.plan.disc) {
      const [x, y] = on(faces[0]);
      const radius = Math.hypot(x - centre[0], y - centre[1]);
      pen.arc(...at(centre), Math.min(radius, 2 * this.far) * scale, 0, 2 * Math.PI);
    } else {
      const far = 1.2 * this.far;
      let corners = [[far, far], [-far, far], [-far, -far], [far, -far]];
      for (const face of faces) {
        const n = [Math.cos(face.turn + turned), Math.sin(face.turn + turned)], p = on(face);
        corners = clipped(corners, ([x, y]) => (x - p[0]) * n[0] + (y - p[1]) * n[1]);
      }
      corners.forEach((corner, i) => (i ? pen.lineTo(...at(corner)) : pen.moveTo(...at(corner))));
    }
    pen.fill();
    const [x, y] = at(centre);
    pen.strokeStyle = color("--muted");
    pen.beginPath();
    pen.moveTo(x - 5, y);
    pen.lineTo(x + 5, y);
    pen.moveTo(x, y - 5);
    pen.lineTo(x, y + 5);
    pen.stroke();
  }

  fingerOn(pen, tip, { j, e }) {
    pen.save();
    pen.translate(...tip);
    pen.rotate(Math.atan2(-e[1], e[0]));
    pen.fillStyle = color(`--finger${j}`);
    pen.beginPath();
    pen.roundRect(0, -WIDE / 2, LONG, WIDE, [0, 7, 7, 0]);
    pen.fill();
    pen.restore();
    pen.fillStyle = color("--on-finger");
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(`${j}`, tip[0] + LONG / 2 * e[0], tip[1] - LONG / 2 * e[1]);
  }

  // Along a ray, from a place; one that pushes ends there, where it is to.
  force(pen, place, e, newton, name, toIt = false) {
    const length = this.reach * Math.sqrt(Math.abs(newton) / this.strongest) * Math.sign(newton);
    if (Math.abs(length) < 2) return;
    const way = [e[0] * Math.sign(length), -e[1] * Math.sign(length)], long = Math.abs(length);
    const back = toIt && newton < 0 ? long : 0;
    const from = [place[0] - way[0] * back, place[1] - way[1] * back];
    pointed(pen, from, way, long, name);
  }
}

// The part of a polygon where a linear function is not positive.
function clipped(corners, value) {
  return corners.flatMap((a, i) => {
    const b = corners[(i + 1) % corners.length], va = value(a), vb = value(b);
    const crossing = [a[0] + (b[0] - a[0]) * va / (va - vb), a[1] + (b[1] - a[1]) * va / (va - vb)];
    return [...(va <= 0 ? [a] : []), ...((va < 0) !== (vb < 0) && va !== vb ? [crossing] : [])];
  });
}

Picture = Hand;
