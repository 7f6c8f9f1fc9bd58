//! Readings that are off what the others beside them read, one by one or several side by side.
//!
//! Of readings in the order of their places, a few side by side are outliers where
//!
//! - each is off the chord between the reading before them and the one after them,
//! - the first is off the line through the two before it, and the last off that through the two
//!   after it: at a step, or where the error bends, the line from either side alone goes on.
//!
//! What an error of the place bends between two readings grows with the gaps to both, so a reading
//! between wide gaps counts the less. Those farthest off leave first, and the others are looked at
//! again without them. In the end every reading returns that the others before and after it explain,
//! in place or in time: outliers make those beside them look off.

use crate::fit::median_magnitude;
use crate::linear::MAD_TO_SIGMA;

/// Most outliers side by side. More are an effect that stays.
pub const SIDE_BY_SIDE: usize = 6;

/// What counts as off, and from how many readings on any can be.
pub struct Limits {
    /// Standard deviations of the readings about the others.
    pub wild: f64,
    /// With more than this share of outliers the readings have an effect, and no outliers.
    pub share: f64,
    /// Fewest readings that show the one that is wrong.
    pub fewest: usize,
    /// About as many give the scale.
    pub sample: usize,
}

/// The normal distribution has this share within one standard deviation.
const WITHIN: f64 = 0.6827;

/// Places closer than this are one, turns.
const ONE_PLACE: f64 = 1e-9;

/// Readings of one turn: places in turns from 0 to 1, errors, and the readings in turns.
struct Readings<'a> {
    place: Vec<f64>,
    error: &'a [f64],
    /// How far a reading may be off a chord, one between two other places, and that per product of
    /// the gaps, for what bends.
    limit: f64,
    places: f64,
    bent: f64,
}

/// Rows of the outliers and how far each is off the chord between the others beside it.
///
/// `angle` and `indicated` are in any unit of which a turn has `period`. A sensor that rounds is
/// off by its counts, which its errors span: up to two of them no reading is an outlier.
pub fn outliers(
    error: &[f64],
    angle: &[f64],
    indicated: &[f64],
    period: f64,
    limits: &Limits,
) -> Vec<(usize, f64)> {
    let n = error.len();
    let fewest = limits.fewest.max(2 * SIDE_BY_SIDE);
    if n < fewest {
        return Vec::new();
    }
    let place: Vec<f64> = angle
        .iter()
        .map(|x| x.rem_euclid(period) / period)
        .collect();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| place[a].total_cmp(&place[b]));
    let mut readings = Readings {
        place,
        error,
        limit: 1e-12 * period,
        places: 0.0,
        bent: 0.0,
    };
    readings.measure(&order, limits);
    let mut far = vec![false; n];
    let most = (limits.share * n as f64) as usize;
    let (mut kept, mut gone, mut counted) = (order.clone(), 0, false);
    while kept.len() >= fewest {
        let mut found = readings.candidates(&kept);
        if !found.is_empty() && !counted {
            let counts = 2.0 * sensor_count(error, indicated, period);
            readings.limit = readings.limit.max(counts);
            counted = true;
            found = readings.candidates(&kept);
        }
        if found.is_empty() {
            break;
        }
        found.sort_by(|a, b| b.off.total_cmp(&a.off).then(a.first.cmp(&b.first)));
        let m = kept.len();
        let mut near = vec![false; m];
        for block in found {
            let members = || (0..block.size).map(|k| (block.first + k) % m);
            // Beside one that is farther off it may only look so.
            if !members().any(|k| near[k]) {
                members().for_each(|k| far[kept[k]] = true);
                gone += block.size;
            }
            for k in 0..block.size + 2 * SIDE_BY_SIDE {
                near[(block.first + m - SIDE_BY_SIDE + k) % m] = true;
            }
        }
        if gone > most {
            return Vec::new();
        }
        kept.retain(|&row| !far[row]);
    }
    readings.returned(&order, far)
}

/// Readings side by side, and the least by which one of them is off.
struct Block {
    first: usize,
    size: usize,
    off: f64,
}

impl Readings<'_> {
    /// How far row `k` is off the chord from row `a` to row `b`, and that less what may be bent.
    fn chord(&self, a: usize, k: usize, b: usize) -> (f64, f64) {
        let back = gap(self.place[a], self.place[k]);
        let ahead = gap(self.place[k], self.place[b]);
        let share = if back + ahead > ONE_PLACE {
            back / (back + ahead)
        } else {
            0.5
        };
        let off = (self.error[k] - (1.0 - share) * self.error[a] - share * self.error[b]).abs();
        let apart = back.min(ahead) > ONE_PLACE;
        let bent = if apart {
            self.places.max(self.bent * back * ahead)
        } else {
            0.0
        };
        (off, off * self.limit / self.limit.max(bent))
    }

    /// How far row `k` is off the line through the rows `a` and `b`, from there on level where
    /// both are at one place.
    fn line(&self, a: usize, b: usize, k: usize) -> f64 {
        let step = signed(self.place[a], self.place[b]);
        let slope = if step.abs() <= ONE_PLACE {
            0.0
        } else {
            (self.error[b] - self.error[a]) / step
        };
        (self.error[k] - self.error[b] - slope * signed(self.place[b], self.place[k])).abs()
    }

    /// Measures how far readings are off the chord of their neighbours, and places off that of the
    /// places beside them.
    ///
    /// Of readings in counts most may be exactly on it, the others one count off: it is no less
    /// than what as many as are within one standard deviation of normal readings are within.
    fn measure(&mut self, order: &[usize], limits: &Limits) {
        let (n, sample) = (order.len(), limits.sample);
        // From a line between two normal readings a third is off by 3/2 of the variance.
        let wild = limits.wild / 1.5f64.sqrt();
        let some = || (0..n).step_by((n / sample).max(1));
        let spread = |mut off: Vec<f64>| {
            let spread = MAD_TO_SIGMA * median_magnitude(&off, sample);
            if off.is_empty() {
                0.0
            } else {
                spread.max(rank(&mut off, WITHIN))
            }
        };
        let off = some().map(|i| {
            self.chord(order[(i + n - 1) % n], order[i], order[(i + 1) % n])
                .0
        });
        self.limit = self.limit.max(wild * spread(off.collect()));
        // Where it bends, a chord over several readings and places is off by more than noise.
        let is_new =
            |i: usize| gap(self.place[order[(i + n - 1) % n]], self.place[order[i]]) > ONE_PLACE;
        let first: Vec<usize> = (0..n).filter(|&i| is_new(i)).collect();
        if first.len() < 3 {
            return;
        }
        let chords = |reach: usize| -> (Vec<f64>, Vec<f64>) {
            let chord = |i: usize| {
                let next = first.partition_point(|&k| k <= i);
                let own = first[(next + first.len() - 1) % first.len()];
                let before = reach.max((i + n - own) % n + 1);
                let after = reach.max((first[next % first.len()] + n - i) % n);
                let (a, k, b) = (
                    order[(i + n - before) % n],
                    order[i],
                    order[(i + after) % n],
                );
                let gaps = gap(self.place[a], self.place[k]) * gap(self.place[k], self.place[b]);
                (self.chord(a, k, b).0, gaps)
            };
            some().map(chord).unzip()
        };
        let (near, (far, mut gaps)) = (chords(1).0, chords(SIDE_BY_SIDE));
        self.places = wild * spread(near);
        self.bent = wild * spread(far) / crate::spectrum::median(&mut gaps);
    }

    /// Blocks of the kept rows that may be outliers.
    fn candidates(&self, kept: &[usize]) -> Vec<Block> {
        let n = kept.len();
        let at = |i: usize| kept[(i + n) % n];
        let into = |i: usize| self.line(at(i + n - 2), at(i + n - 1), at(i));
        let out = |i: usize| self.line(at(i + 2), at(i + 1), at(i));
        let mut found = Vec::new();
        for first in 0..n {
            let before = into(first);
            if before <= self.limit {
                continue;
            }
            for size in 1..=SIDE_BY_SIDE {
                let last = first + size - 1;
                let off = (first..=last)
                    .map(|k| self.chord(at(first + n - 1), at(k), at(last + 1)).1)
                    .fold(before.min(out(last)), f64::min);
                if off > self.limit {
                    found.push(Block { first, size, off });
                }
            }
        }
        found
    }

    /// Those of the rows that stay far off the kept ones before and after, in place and in time.
    fn returned(&self, order: &[usize], mut far: Vec<bool>) -> Vec<(usize, f64)> {
        let n = order.len();
        let rows: Vec<usize> = (0..n).filter(|&row| far[row]).collect();
        if rows.is_empty() {
            return Vec::new();
        }
        let mut rank = vec![0; n];
        order.iter().enumerate().for_each(|(i, &row)| rank[row] = i);
        loop {
            let mut found = Vec::new();
            for &row in rows.iter().filter(|&&row| far[row]) {
                let next = |step: usize| {
                    let along = (1..n).map(|k| order[(rank[row] + k * step) % n]);
                    along.clone().find(|&other| !far[other]).unwrap_or(row)
                };
                let (distance, off) = self.chord(next(n - 1), row, next(1));
                let before = |row: usize| (0..row).rev().find(|&other| !far[other]);
                let after = |row: usize| (row + 1..n).find(|&other| !far[other]);
                let a = before(row).or(after(row)).unwrap_or(row);
                let b = after(row).unwrap_or(a);
                let share = row.abs_diff(a) as f64 / a.abs_diff(b).max(1) as f64;
                // Where the joint starts or stops, the error jumps, on no line from either side,
                // and comes back little by little.
                let jump = self.error[b] - self.error[a];
                let beyond = |from: usize, to: Option<usize>| {
                    to.map_or(f64::INFINITY, |to| {
                        let slope = (self.error[from] - self.error[to]) / (from as f64 - to as f64);
                        (jump - slope * (b as f64 - a as f64)).abs()
                    })
                };
                let jumps = jump
                    .abs()
                    .min(beyond(a, before(a)))
                    .min(beyond(b, after(b)));
                let away = (self.error[row] - self.error[a] - share * jump).abs();
                if off > self.limit && away > self.limit.max(2.0 * jumps) {
                    found.push((row, distance));
                }
            }
            let same = found.len() == far.iter().filter(|&&is| is).count();
            if same {
                // More of them in a row are an effect.
                let beside = |row: usize| row.saturating_sub(SIDE_BY_SIDE)..=row + SIDE_BY_SIDE;
                let many = |row: usize| beside(row).filter(|&k| k < n && far[k]).count();
                found.retain(|&(row, _)| many(row) <= SIDE_BY_SIDE);
                return found;
            }
            far.fill(false);
            found.iter().for_each(|&(row, _)| far[row] = true);
        }
    }
}

/// Count of a sensor, by the least difference of its readings and of their steps: the lattice that
/// all lie on; 0 for none, and for that of places, which is no finer than they are and not spanned by
/// the errors.
pub fn sensor_count(error: &[f64], indicated: &[f64], period: f64) -> f64 {
    // Smaller differences are the rounding of sums.
    let differences = |mut values: Vec<f64>| -> Vec<f64> {
        values.sort_by(f64::total_cmp);
        let steps = values.windows(2).map(|pair| pair[1] - pair[0]);
        steps.filter(|&step| step > 1e-9 * period).collect()
    };
    let steps = differences(indicated.to_vec());
    if steps.is_empty() {
        return 0.0;
    }
    // At even places all steps are many counts, and differ by one.
    let apart = differences(steps.clone());
    let each = steps.iter().chain(&apart).copied();
    let finest = each.fold(f64::INFINITY, f64::min);
    // The longer the rule, the better it is known.
    let counts: f64 = steps.iter().map(|step| (step / finest).round()).sum();
    let count = steps.iter().sum::<f64>() / counts;
    let (mut low, mut high, mut away) = (0.0f64, 0.0f64, 0.0);
    for step in &steps {
        away += step / count - (step / finest).round();
        (low, high) = (low.min(away), high.max(away));
    }
    let places = indicated.iter().zip(error).map(|(x, e)| x - e).collect();
    let grid = differences(places)
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let mut some = error.to_vec();
    let span = rank(&mut some, 0.8) - rank(&mut some, 0.2);
    // A twentieth of a count is lost to digits that were cut off.
    if high - low < 0.05 && (count <= 4.0 * span || 2.0 * count < grid) {
        count
    } else {
        0.0
    }
}

/// The value that a share of them do not exceed.
fn rank(values: &mut [f64], share: f64) -> f64 {
    let k = (share * (values.len() - 1) as f64).round() as usize;
    *values.select_nth_unstable_by(k, f64::total_cmp).1
}

/// From one place ahead to another, turns.
fn gap(from: f64, to: f64) -> f64 {
    if to >= from {
        to - from
    } else {
        to - from + 1.0
    }
}

/// From one place to another the short way, turns.
fn signed(from: f64, to: f64) -> f64 {
    let apart = to - from;
    apart - apart.round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_side_by_side_are_told_and_a_step_that_stays_is_none() {
        let limits = Limits {
            wild: 8.0,
            share: 0.2,
            fewest: 12,
            sample: 4096,
        };
        let angle: Vec<f64> = (0..360).map(f64::from).collect();
        let clean: Vec<f64> = angle
            .iter()
            .map(|x| x.to_radians().sin() + 0.01 * (x * x).sin())
            .collect();
        let rows = |error: &[f64]| -> Vec<usize> {
            let found = outliers(error, &angle, error, 360.0, &limits);
            found.iter().map(|&(row, _)| row).collect()
        };
        assert!(rows(&clean).is_empty());
        for size in 1..=SIDE_BY_SIDE {
            let mut error = clean.clone();
            for (k, value) in error[100..100 + size].iter_mut().enumerate() {
                *value += if size % 2 == 0 && k % 2 == 1 {
                    -2.0
                } else {
                    2.0
                };
            }
            assert_eq!(rows(&error), (100..100 + size).collect::<Vec<_>>());
        }
        let stays: Vec<f64> = (0..360).map(|k| clean[k] + f64::from(k > 99)).collect();
        assert!(rows(&stays).is_empty());
    }

    #[test]
    fn a_count_is_told_from_even_places() {
        let angle: Vec<f64> = (0..400).map(|k| 0.9 * f64::from(k)).collect();
        let count = 360.0 / 16384.0;
        let read: Vec<f64> = angle.iter().map(|x| (x / count).round() * count).collect();
        let error: Vec<f64> = read.iter().zip(&angle).map(|(a, b)| a - b).collect();
        assert!((sensor_count(&error, &read, 360.0) - count).abs() < 1e-9);
        assert_eq!(sensor_count(&error, &angle, 360.0), 0.0);
    }
}
