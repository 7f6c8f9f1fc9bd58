//! The closed curve of two channels, and the place on it that is nearest to a reading.

/// Parameters of the ellipse, which come before those of the harmonics.
pub(super) const ELLIPSE: usize = 5;

/// Most steps to the nearest place; each about squares the distance left.
const STEPS: usize = 30;

/// A step to the nearest place that changes nothing any more, radians.
const SETTLED: f64 = 1e-13;

/// Longest step to the nearest place, radians.
const LONGEST: f64 = 0.5;

/// A closed curve, in the unit of the channels:
///
/// `cosine = p0 + p2 cos(phi) + sum u cos(m phi) + v sin(m phi)`,
/// `sine = p1 + p3 sin(phi) + p4 cos(phi) + sum v cos(m phi) - u sin(m phi)`,
///
/// a harmonic being `z_(-m) = u + i v` of `cosine + i sine`.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Orders `m` of the harmonics, from 2.
    pub orders: Vec<u32>,
    /// `p0` to `p4`, then `u` and `v` of every harmonic.
    pub parameters: Vec<f64>,
}

/// A place of the curve with its first and second derivative by the phase: (cosine, sine).
pub(super) struct Place {
    pub at: [f64; 2],
    pub along: [f64; 2],
    pub bend: [f64; 2],
}

impl Curve {
    /// The curve at a phase.
    pub(super) fn at(&self, phase: f64) -> Place {
        let p = &self.parameters;
        let (sine, cosine) = phase.sin_cos();
        let mut place = Place {
            at: [p[0] + p[2] * cosine, p[1] + p[3] * sine + p[4] * cosine],
            along: [-p[2] * sine, p[3] * cosine - p[4] * sine],
            bend: [-p[2] * cosine, -p[3] * sine - p[4] * cosine],
        };
        for (i, &order) in self.orders.iter().enumerate() {
            let m = f64::from(order);
            let (s, c) = (m * phase).sin_cos();
            let (u, v) = (p[ELLIPSE + 2 * i], p[ELLIPSE + 2 * i + 1]);
            let (x, y) = (u * c + v * s, v * c - u * s);
            place.at[0] += x;
            place.at[1] += y;
            // d/dphi of z exp(-i m phi) is -i m times it.
            place.along[0] += m * y;
            place.along[1] -= m * x;
            place.bend[0] -= m * m * x;
            place.bend[1] -= m * m * y;
        }
        place
    }

    /// Derivatives of (cosine, sine) by every parameter at a phase, weighted: the row of
    /// `weights . derivative`.
    pub(super) fn row(&self, phase: f64, weights: [f64; 2], row: &mut [f64]) {
        let [x, y] = weights;
        let (sine, cosine) = phase.sin_cos();
        row[..ELLIPSE].copy_from_slice(&[x, y, x * cosine, y * sine, y * cosine]);
        let harmonics = row[ELLIPSE..].chunks_exact_mut(2);
        for (pair, &order) in harmonics.zip(&self.orders) {
            let (s, c) = (f64::from(order) * phase).sin_cos();
            pair.copy_from_slice(&[x * c - y * s, x * s + y * c]);
        }
    }

    /// The phase nearest to a reading, by the variances of the two channels, from `start` on.
    pub(super) fn nearest(&self, reading: [f64; 2], variances: [f64; 2], start: f64) -> f64 {
        let mut phase = start;
        for _ in 0..STEPS {
            let Place { at, along, bend } = self.at(phase);
            let off = [reading[0] - at[0], reading[1] - at[1]];
            let dot =
                |a: [f64; 2], b: [f64; 2]| a[0] * b[0] / variances[0] + a[1] * b[1] / variances[1];
            let plain = dot(along, along);
            let newton = plain - dot(bend, off);
            let step = dot(along, off) / if newton > 0.5 * plain { newton } else { plain };
            if step.is_nan() {
                return phase;
            }
            phase += step.clamp(-LONGEST, LONGEST);
            if step.abs() < SETTLED {
                break;
            }
        }
        phase
    }

    /// Whether there are as many parameters as its orders need.
    pub(super) fn is_whole(&self) -> bool {
        self.parameters.len() == ELLIPSE + 2 * self.orders.len()
    }

    /// The same curve of readings less a middle, in units of a size.
    pub(super) fn moved(&self, middle: [f64; 2], size: f64) -> Self {
        let mut moved = self.clone();
        moved.parameters[0] -= middle[0];
        moved.parameters[1] -= middle[1];
        for value in &mut moved.parameters {
            *value /= size;
        }
        moved
    }

    /// The same curve with harmonics of these orders: those it has not are zero.
    pub(super) fn with(&self, orders: &[u32]) -> Self {
        let mut parameters = self.parameters[..ELLIPSE].to_vec();
        for order in orders {
            let known = self.orders.iter().position(|own| own == order);
            let at = |i: usize| known.map_or(0.0, |k| self.parameters[ELLIPSE + 2 * k + i]);
            parameters.extend([at(0), at(1)]);
        }
        Self {
            orders: orders.to_vec(),
            parameters,
        }
    }

    /// The phase that the ellipse alone gives a reading.
    pub(super) fn phase(&self, reading: [f64; 2]) -> f64 {
        let p = &self.parameters;
        let x = (reading[0] - p[0]) / p[2];
        ((reading[1] - p[1] - p[4] * x) / p[3]).atan2(x)
    }
}

/// Derivatives of the decoded angle by the parameters of the curve, for places on it: a row of
/// radians per unit for each phase.
///
/// A decoder sends every ray from the middle to one angle, so an angle's gradient is at right
/// angles to the ray: `-(ray x derivative) / (ray x along)`.
pub fn angle_slopes(curve: &Curve, phases: &[f64]) -> Vec<f64> {
    let width = curve.parameters.len();
    if !curve.is_whole() {
        return Vec::new();
    }
    let mut rows = vec![0.0; phases.len() * width];
    for (row, &phase) in rows.chunks_exact_mut(width).zip(phases) {
        let Place { at, along, .. } = curve.at(phase);
        let ray = [at[0] - curve.parameters[0], at[1] - curve.parameters[1]];
        let turn = ray[0] * along[1] - ray[1] * along[0];
        curve.row(phase, [ray[1] / turn, -ray[0] / turn], row);
    }
    rows
}
