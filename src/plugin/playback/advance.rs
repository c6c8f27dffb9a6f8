//! One step of a playback.
//!
//! In: a [`Playback`] with the changes of the game, its [`PlaybackState`], and a [`Drive`]. Out: the playback as it is
//! drawn, and a [`Progress`]: what happened during the step.

use super::component::Playback;
use super::drive::Drive;
use super::span::{Span, Travel};
use super::state::{Follow, PlaybackState};

/// What happened in a step.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Progress {
    pub(super) started: bool,
    pub(super) paused: bool,
    /// The times before and after a jump because the game, or the clock that is followed, sought, in seconds; `None`
    /// without one.
    pub(super) seeked: Option<[f32; 2]>,
    /// Whether this moment does not continue the one before: the first one, and seeks.
    pub(super) jumped: bool,
    pub(super) travel: Option<Travel>,
    pub(super) ended: bool,
}

impl PlaybackState {
    /// Advances a playback of a capture that lasts `duration` seconds by one step. Returns the playback after it, and
    /// what happened.
    pub(super) fn advance(&mut self, mut now: Playback, drive: Drive, duration: f32) -> (Playback, Progress) {
        let span = now.span(duration);
        let was_at_end = self.is_at_end_of_loop();
        let mut progress = self.notice(&mut now, &span, drive);
        if now.playing && !span.is_still() {
            match drive {
                Drive::By(delta) => self.run(&mut now, &span, delta, &mut progress),
                Drive::Follow { clock, seconds, jumps } => {
                    let phase = span.phase_at(seconds, now.speed, now.offset);
                    let next = Follow { clock, jumps, speed: now.speed, offset: now.offset, phase };
                    if phase.is_finite() {
                        self.follow(&mut now, &span, next, &mut progress);
                    }
                }
                Drive::Hold => {}
            }
        }
        if !now.playing || !matches!(drive, Drive::Follow { .. }) {
            self.follow = None;
        }
        (self.time, self.returning, self.playing) = (now.time, now.returning, now.playing);
        // Starting over is a jump: followers do not play backwards to the start.
        let wrapped = progress.travel.is_some_and(|travel| travel.wraps() || was_at_end && travel.is_forward());
        if progress.jumped || wrapped {
            self.jumps = self.jumps.wrapping_add(1);
        }
        (now, progress)
    }

    /// Compares the playback with its state after the last step: the game has set whatever differs.
    fn notice(&mut self, now: &mut Playback, span: &Span, drive: Drive) -> Progress {
        now.time = span.clamped(now.time);
        let following = matches!(drive, Drive::Follow { .. });
        let first = self.span.is_none();
        // A range that has changed may move the time, which is no seek.
        let turned = span.repeat().turns_round() && now.returning != self.returning;
        let moved = now.time != span.clamped(self.time) || turned;
        // A clock that is followed sets the time; setting it otherwise is not a seek.
        let seeked = !first && moved && !(following && now.playing);
        if self.span != Some(*span) {
            self.follow = None;
            self.span = Some(*span);
            self.phase = span.phase(now.time, now.returning);
        }
        let started = now.playing && !self.playing;
        // Played at the end, it starts over, unless the clock says where it is.
        let is_over = span.is_over(span.phase(now.time, now.returning), now.speed > 0.0);
        let restarts = started && is_over && now.speed != 0.0 && !span.is_still() && matches!(drive, Drive::By(_));
        if restarts {
            now.replay();
            now.time = span.clamped(now.time);
        }
        if first || seeked || restarts {
            self.phase = span.phase(now.time, now.returning);
            (self.fresh, self.over) = (true, false);
        }
        Progress {
            started,
            paused: !now.playing && self.playing,
            seeked: ((seeked || restarts) && !first).then_some([self.time, now.time]),
            jumped: first || seeked || restarts,
            ..Progress::default()
        }
    }

    /// Plays `delta` seconds of the game's time.
    fn run(&mut self, now: &mut Playback, span: &Span, delta: f64, progress: &mut Progress) {
        let to = self.phase + delta * f64::from(now.speed);
        if !to.is_finite() || to == self.phase {
            return;
        }
        let travel = self.go(now, span, self.phase, to);
        if travel.at_end {
            now.playing = false;
            progress.ended = true;
        }
        progress.travel = Some(travel);
    }

    /// Plays, or jumps, to the time of a shared clock.
    fn follow(&mut self, now: &mut Playback, span: &Span, next: Follow, progress: &mut Progress) {
        let before = self.follow.replace(next);
        match before {
            Some(before) if (Follow { phase: before.phase, ..next }) == before => {
                if next.phase != before.phase {
                    let travel = self.go(now, span, before.phase, next.phase);
                    progress.ended = travel.at_end && !self.over;
                    self.over = travel.at_end;
                    progress.travel = Some(travel);
                }
            }
            _ => {
                self.go(now, span, next.phase, next.phase);
                self.fresh = true;
                self.over = span.is_over(next.phase, now.speed >= 0.0);
                // The first moment is not a seek.
                if !progress.jumped && now.time != self.time {
                    progress.seeked = Some([self.time, now.time]);
                }
                progress.jumped = true;
            }
        }
    }

    fn go(&mut self, now: &mut Playback, span: &Span, from: f64, to: f64) -> Travel {
        let travel = span.travel(from, to, std::mem::take(&mut self.fresh));
        self.phase = travel.phase();
        (now.time, now.returning) = span.moment(self.phase);
        travel
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::playback::repeat::Repeat;
    use bevy::ecs::entity::Entity;

    /// A playback of two seconds with its memory.
    struct Player(Playback, PlaybackState);

    impl Player {
        fn new(playback: Playback) -> Self {
            Self(playback, PlaybackState::default())
        }

        fn step(&mut self, drive: Drive) -> Progress {
            let (next, progress) = self.1.advance(self.0, drive, 2.0);
            self.0 = next;
            progress
        }

        fn follow(&mut self, seconds: f64, jumps: u32) -> Progress {
            self.step(Drive::Follow { clock: Entity::PLACEHOLDER, seconds, jumps })
        }
    }

    #[test]
    fn start_pause_and_seek_are_noticed_once() {
        let mut player = Player::new(Playback::default());
        let first = player.step(Drive::By(0.25));
        assert!(first.started && first.seeked.is_none(), "the first step starts, and does not seek");
        assert!(!player.step(Drive::By(0.25)).started, "the second one does not start again");
        player.0.pause();
        assert!(player.step(Drive::By(0.25)).paused, "a pause");
        assert_eq!(player.step(Drive::By(0.25)), Progress::default(), "nothing happens while paused");
        player.0.seek(1.25);
        assert_eq!(player.step(Drive::By(0.25)).seeked, Some([0.5, 1.25]), "but a seek");
        player.0.play();
        assert!(player.step(Drive::By(0.25)).started, "and a start");
        assert_eq!(player.0.time, 1.5, "from there");
    }

    #[test]
    fn the_end_comes_once_and_is_no_pause() {
        let mut player = Player::new(Playback { repeat: Repeat::Once, ..Playback::default() });
        player.step(Drive::By(1.5));
        let end = player.step(Drive::By(1.5));
        assert!(end.ended && !player.0.playing, "it ends");
        assert_eq!(player.step(Drive::By(1.5)), Progress::default(), "and that is all");
        player.0.play();
        let again = player.step(Drive::By(1.5));
        assert_eq!((again.seeked, again.started), (Some([2.0, 0.0]), true), "played at the end, it starts over");
        assert!(!again.ended, "which is no end");
        assert_eq!(player.0.time, 1.5, "from its beginning");
        player.0.seek(9.0);
        player.0.pause();
        assert_eq!(player.step(Drive::By(0.0)).seeked, Some([1.5, 2.0]), "sought beyond the end, it is there");
        (player.0.speed, player.0.offset) = (-1.0, 0.5);
        player.0.play();
        assert_eq!(player.step(Drive::By(0.5)).seeked, None, "backwards it has not ended");
        assert!(player.step(Drive::By(9.0)).ended, "until it is at the start");
        player.0.play();
        player.0.end = 2.0;
        assert_eq!(player.step(Drive::By(0.0)).seeked, Some([0.0, 1.5]), "from where it starts over by its offset");
        let stopped = Playback { time: 2.0, speed: 0.0, repeat: Repeat::Once, ..Playback::default() };
        let mut player = Player::new(stopped);
        player.step(Drive::By(1.0));
        assert_eq!(player.0, stopped, "at speed 0 it stands at its end");
    }

    #[test]
    fn small_steps_add_up_without_rounding() {
        let mut player = Player::new(Playback::default());
        for _ in 0..60_000 {
            player.step(Drive::By(1.0 / 60.0));
        }
        let off = player.0.time.min(2.0 - player.0.time);
        assert!(off < 1e-6, "1000 s in 60 steps a second end where a loop does, not {off} s beside it");
    }

    #[test]
    fn a_clock_decides_where_its_followers_are() {
        let mut player = Player::new(Playback { time: 1.75, ..Playback::default() });
        let first = player.follow(10.5, 0);
        assert!(first.started && first.seeked.is_none() && player.0.time == 0.5, "at once");
        player.0.time = 1.9;
        assert_eq!(player.follow(11.0, 0).seeked, None, "what else sets the time does not count");
        assert_eq!(player.0.time, 1.0, "where the clock is");
        assert_eq!(player.follow(12.5, 0).travel.map(|travel| travel.turns), Some(1), "it loops");
        assert_eq!(player.follow(13.0, 1).seeked, Some([0.5, 1.0]), "a jump of the clock is a seek");
        player.0.speed = -1.0;
        assert_eq!(player.follow(13.0, 1).seeked, None, "half a loop from either end is the same moment");
        player.0.pause();
        player.follow(14.5, 1);
        assert_eq!(player.0.time, 1.0, "a pause holds one follower");
        player.0.play();
        player.follow(14.75, 1);
        assert_eq!(player.0.time, 1.25, "and it falls in again");
        player.follow(f64::NAN, 1);
        assert_eq!(player.0.time, 1.25, "a clock that shows no number is waited for");
    }

    #[test]
    fn a_follower_ends_whenever_the_clock_passes_its_end() {
        let mut player = Player::new(Playback { repeat: Repeat::Once, offset: -1.0, ..Playback::default() });
        player.follow(0.0, 0);
        assert_eq!(player.0.time, 0.0, "before its beginning it waits there");
        player.follow(2.0, 0);
        assert_eq!(player.0.time, 1.0, "the offset is a second");
        assert!(player.follow(3.5, 0).ended && player.0.playing, "at its end it still follows");
        assert!(!player.follow(4.0, 0).ended, "it ends once");
        assert!(!player.follow(2.0, 0).ended && player.0.time == 1.0, "the clock may run backwards");
        assert!(player.follow(3.0, 0).ended, "and forwards again");
    }

    #[test]
    fn a_moment_sought_counts_as_passed_when_it_is_played_from() {
        let mut player = Player::new(Playback::default());
        let passes =
            |progress: &Progress, time| progress.travel.is_some_and(|travel| travel.legs().any(|leg| leg.passes(time)));
        assert!(passes(&player.step(Drive::By(0.5)), 0.0), "the beginning, when it starts there");
        assert!(!passes(&player.step(Drive::By(0.5)), 0.5), "never twice");
        player.0.seek(1.5);
        assert!(passes(&player.step(Drive::By(0.25)), 1.5), "where it was sought");
        player.0.seek(0.25);
        player.0.pause();
        assert!(!passes(&player.step(Drive::By(0.25)), 0.25), "not while paused");
        player.0.play();
        assert!(passes(&player.step(Drive::By(0.25)), 0.25), "but then");
    }

    #[test]
    fn the_end_of_a_loop_can_be_sought_but_not_played_to() {
        let mut player = Player::new(Playback { start: 0.1, end: 1.9, ..Playback::default() });
        player.step(Drive::By(1.8));
        assert!((player.1.seconds() - 0.1).abs() < 1e-6, "played to its end, it is at {}", player.1.seconds());
        player.0.pause();
        player.0.seek(1.9);
        player.step(Drive::By(1.0));
        assert!((player.1.seconds() - 1.9).abs() < 1e-6, "sought, it is at its end, not at {}", player.1.seconds());
        assert!(player.1.is_at_end_of_loop(), "and knows it");
        player.0.play();
        player.step(Drive::By(0.25));
        assert!((player.1.seconds() - 0.35).abs() < 1e-6, "from there it starts over: {}", player.1.seconds());
        assert!(!player.1.is_at_end_of_loop(), "no longer at the end");
    }

    #[test]
    fn infinite_times_are_the_ends() {
        for drive in [Drive::By(0.0), Drive::Hold] {
            let mut player = Player::new(Playback { speed: -1.0, ..Playback::default() });
            player.step(drive);
            player.0.replay();
            assert_eq!(player.step(drive).seeked, Some([0.0, 2.0]), "backwards it is replayed from the end");
            assert_eq!(player.0.time, 2.0, "and stands there until time goes by, {drive:?}");
            player.0.seek(f32::NEG_INFINITY);
            player.step(drive);
            assert_eq!(player.0.time, 0.0, "the other end");
        }
    }

    #[test]
    fn times_are_those_of_the_range() {
        let mut player = Player::new(Playback { start: 0.5, end: 1.5, ..Playback::paused_at(9.0) });
        assert_eq!(player.step(Drive::By(0.0)).seeked, None, "the first moment is no seek");
        assert_eq!(player.0.time, 1.5, "but in the range");
        player.0.seek(-3.0);
        assert_eq!(player.step(Drive::By(0.0)).seeked, Some([1.5, 0.5]), "a seek says where it has arrived");
        player.0.seek(0.25);
        assert_eq!(player.step(Drive::By(0.0)).seeked, None, "which is where it was");
        player.0.start = 1.0;
        assert_eq!(player.step(Drive::By(0.0)).seeked, None, "nor is a range that leaves it behind");
        assert_eq!(player.0.time, 1.0, "the range is where it is");
    }

    #[test]
    fn followers_of_a_player_see_its_jumps() {
        let mut player = Player::new(Playback::default());
        let mut jumps = |change: fn(&mut Playback), delta| {
            let before = player.1.jumps;
            change(&mut player.0);
            player.step(Drive::By(delta));
            player.1.jumps - before
        };
        assert_eq!(jumps(|_| (), 0.25), 1, "the first moment");
        assert_eq!(jumps(|_| (), 0.5), 0, "time that passes");
        assert_eq!(jumps(|playback| playback.seek(1.75), 0.125), 1, "a seek");
        assert_eq!(jumps(|_| (), 0.5), 1, "a loop");
        assert_eq!(jumps(|playback| playback.repeat = Repeat::PingPong, 1.75), 0, "not a turn");
    }

    #[test]
    fn a_range_that_changes_is_no_seek() {
        let mut player = Player::new(Playback::default());
        player.step(Drive::By(0.75));
        player.0.end = 1.0;
        assert_eq!(player.step(Drive::By(0.5)).seeked, None, "the game moved the out point, not the time");
        assert_eq!(player.0.time, 0.25, "and the new range is played");
    }
}
