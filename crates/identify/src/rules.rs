//! Thresholds of the search and of the judgement, in units of whitened sums of squares (twice
//! log-likelihoods). Set on tuning seeds (`kort prove --seed` below 1000, and proofs that newer ones
//! replaced), never on reported ones.

/// Cost of one more parameter.
pub const PER_PARAMETER: f64 = 6.0;
/// What an effect must gain to be believed at all.
pub const BELIEVE: f64 = 80.0;
/// ... of what slow turbulence of the inflow looks like.
pub const BELIEVE_LIKE_TURBULENCE: f64 = 300.0;
/// ... and as a share of what was gained before: the rest of an effect whose true form
/// differs a little from ours is not another effect.
pub const SHARE_OF_FIRST: f64 = 0.02;
/// Least size: root mean square of its response over full scale, on some channel.
pub const LEAST_SIZE: f64 = 0.0012;
/// ... of something that changes freely with time: light turbulence of the inflow is no finding.
pub const LEAST_SIZE_KNOTS: f64 = 0.004;
/// An effect this large counts whatever its share.
pub const CLEAR_SIZE: f64 = 0.004;
/// Share of the gain that must hold on left-out blocks.
pub const HOLDS: f64 = 0.4;
/// ... and for something that changes freely with time, whose knots follow it coarsely only.
pub const HOLDS_KNOTS: f64 = 0.2;
/// Rivals closer than this cannot be told apart.
pub const MARGIN: f64 = 12.0;
/// ... or closer than this share of what the effect gains.
pub const MARGIN_SHARE: f64 = 0.02;
/// ... or, for effects that the catalogue knows to be confused, this share.
pub const MATES_SHARE: f64 = 0.12;
/// How much better a term without a name must be than the best name to take its place, as a share of
/// what the names gain.
pub const TERM_AHEAD: f64 = 0.025;
/// What a term must gain on top of names to stand beside them, as a share of what they gain.
pub const TERM_SHARE: f64 = 0.06;
/// Share of what several names explain together that one term alone must reach to replace them.
pub const TERM_ALONE: f64 = 0.85;
/// ... where one of the names changes freely with time and so bends to any physics.
pub const TERM_FOR_KNOTS: f64 = 0.6;
/// Least gain of a term.
pub const TERM_LEAST: f64 = 20.0;
/// Error above the noise, root mean square over full scale, below which nothing is sought:
/// light turbulence of the inflow leaves as much.
pub const LEAST_EXCESS: f64 = 0.002;
/// ... and above which a mismatch is real even if nothing describes it.
pub const REAL_EXCESS: f64 = 0.006;
/// Share of the squared error above the noise, more of which a first name may not leave without a second
/// look under white noise.
pub const LOOK_AGAIN: f64 = 0.5;
/// Changes in mid-run must leave less than this share of the squared error above the noise that
/// names leave.
pub const CHANGE_LEAVES: f64 = 0.6;
/// Share of the baseline's error above the noise that a name may leave, while what it leaves is
/// real: more, and the physics is not in the catalogue.
pub const MAY_LEAVE: f64 = 0.10;
/// ... several names together.
pub const SEVERAL_MAY_LEAVE: f64 = 0.05;
/// A change in mid-run that names took for a switched term may leave this much more than they did.
pub const CHANGE_FOR_SWITCH: f64 = 1.1;
/// A rival stands beside the leader if it removes at least this share of what the leader removes on
/// held-out data.
pub const RIVAL_SHARE: f64 = 0.6;
/// Share of the held-out error above the noise that names must remove where much is left beside them.
pub const LEAST_REMOVED: f64 = 0.5;
/// Share below which a name is set aside where much is left.
pub const LEAST_OF_A_FINDING: f64 = 0.2;
/// ... where another explains more.
pub const LEAST_OF_A_LATER_FINDING: f64 = 0.4;
/// ... by something free in time, which bends to anything a little; or by a relative where another has
/// several times its gain: the rest of an effect whose true form differs from ours looks like what it is
/// known to be confused with.
pub const LEAST_OF_A_RELATIVE: f64 = 0.8;
/// How many times the gain of its relative that is.
pub const RELATIVE_GAIN: f64 = 4.0;
/// How much less sure a name is beside physics that has none.
pub const BESIDE_UNKNOWN: f64 = 0.1;
/// Share of the distance at which rivals are told apart, over which the odds of one fall by a factor e.
/// Set on three proofs, none of them the reported one.
pub const ODDS_FALL: f64 = 0.04;
/// Share of that distance by which something free in time stands behind a name with a form of its own that
/// fits as well.
pub const BENDS: f64 = 0.1;
/// Share of the gain that terms without a name may hold beside names.
pub const UNNAMED_SHARE: f64 = 0.15;
/// How much more names may leave where a measured column drives.
pub const DRIVER_LEAVES: f64 = 4.0;
/// A name must explain at least this share of what the best term explains to be followed.
pub const LEAST_OF_TERM: f64 = 0.35;
/// Share of what the best gains, short of which a candidate is fitted no further under the best's noise.
pub const NEAR_THE_LEADER: f64 = 0.7;
/// Share of what a finding gains, by which a candidate may trail it and still be fitted as its rival.
pub const OUT_OF_THE_RACE: f64 = 0.3;
/// Share of the best gain, after the first steps of a fit, short of which a candidate goes no further.
pub const SLOW_START: f64 = 0.2;
/// Share of what something free in time gains, above which a name with a form of its own goes before it.
pub const FORMED_SHARE: f64 = 0.45;
/// Most effects found in one recording.
pub const MOST_FOUND: usize = 3;
/// Effects re-fitted in a round.
pub const REFITTED: usize = 9;
