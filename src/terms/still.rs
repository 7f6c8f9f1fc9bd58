//! Readings that do not depend on those before: a block of them at once.

use super::block::{BLOCK, Block, Given, padded};
use super::prepared::Terms;
use super::signals::Signal;
use super::travel::{Friction, Pull};

impl Terms {
    /// Goals of the first `len` readings of a block, NaN where they have none, and the way
    /// during the delay.
    pub(super) fn aim<const N: usize>(&self, block: &mut Block<N>, len: usize) {
        let n = padded::<N>(len);
        let (level, x) = (block.work.rows(n).value, &block.x[..n]);
        let (goal, delayed) = (&mut block.goal[..n], &mut block.delayed[..n]);
        self.aim_at(&block.signals, x, level, goal, delayed);
    }

    /// Goal and way of one reading.
    pub(super) fn aim_one(&self, x: f64, signals: &Given<1>) -> (f64, f64) {
        let (mut level, mut goal, mut delayed) = ([0.0], [0.0], [0.0]);
        self.aim_at(signals, &[x], &mut level, &mut goal, &mut delayed);
        (goal[0], delayed[0])
    }

    #[inline]
    fn aim_at<const N: usize>(
        &self,
        signals: &Given<N>,
        x: &[f64],
        level: &mut [f64],
        goal: &mut [f64],
        delayed: &mut [f64],
    ) {
        self.fill_delayed(signals, delayed);
        self.fill_level(signals, level);
        // The series is undone first where its argument is the indicated angle.
        if self.is_indicated() {
            self.corrections.run(x, goal);
        } else {
            goal.copy_from_slice(x);
        }
        for i in 0..goal.len() {
            let aim = goal[i] - level[i];
            let is_aim = (aim + delayed[i]).is_finite();
            goal[i] = if is_aim { aim } else { f64::NAN };
        }
    }

    fn fill_delayed<const N: usize>(&self, signals: &Given<N>, delayed: &mut [f64]) {
        if self.delay == 0.0 {
            return delayed.fill(0.0);
        }
        let velocity = &signals.of(Signal::Velocity)[..delayed.len()];
        for i in 0..delayed.len() {
            delayed[i] = velocity[i] * self.delay;
        }
    }

    /// True angles behind the first `len` readings.
    pub(super) fn correct_still(&self, block: &mut Block<BLOCK>, len: usize) {
        let n = padded::<BLOCK>(len);
        self.aim(block, len);
        let Block {
            signals,
            out,
            goal,
            delayed,
            direction,
            work,
            ..
        } = block;
        let pull = Pull {
            direction: &direction[..n],
            friction: Friction::None,
        };
        self.find(&goal[..n], &pull, signals, &mut out[..n], work);
        let (out, delayed) = (&mut out[..n], &delayed[..n]);
        for i in 0..n {
            out[i] += delayed[i];
        }
    }

    /// Errors at the angles of the first `len` readings, without what travel adds; the angles
    /// that the encoder saw are in `onward`.
    pub(super) fn error_still<const N: usize>(&self, block: &mut Block<N>, len: usize) {
        let n = padded::<N>(len);
        let Block {
            signals,
            x,
            out,
            goal,
            delayed,
            onward,
            work,
            ..
        } = block;
        self.fill_delayed(signals, &mut delayed[..n]);
        let (seen, level) = (&mut onward[..n], &mut goal[..n]);
        let x = &x[..n];
        for i in 0..n {
            seen[i] = x[i] - delayed[i];
        }
        self.errors().run(seen, &mut out[..n]);
        self.fill_level(signals, level);
        self.fill_shape(signals, seen, work);
        let (out, error) = (&mut out[..n], work.rows(n).error);
        let delayed = &delayed[..n];
        for i in 0..n {
            out[i] = out[i] + level[i] + error[i] - delayed[i];
        }
    }
}
