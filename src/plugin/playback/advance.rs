//! One step of a playback.
//!
//! In: a [`Playback`] with the changes of the game, its [`PlaybackState`], and a [`Drive`]. Out: the playback after the
//! step, whose time is drawn, and a [`Progress`] with the events of the step.

use super::component::Playback;
use super::drive::Drive;
use super::span::{Span, Travel};
use super::state::{Follow, PlaybackState};

/// The events of a step.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Progress {
    pub(super) started: bool,
    pub(super) paused: bool,
    /// The times before and after a seek by the game or by the followed clock, in seconds; `None` without a seek.
    pub(super) seeked: Option<[f32; 2]>,
    /// Whether the time does not continue from the step before: in the first step, and after seeks.
    pub(super) jumped: bool,
    pub(super) travel: Option<Travel>,
    pub(super) ended: bool,
}

impl PlaybackState {
    /// Advances a playback of a capture that lasts `duration` seconds by one step. Returns the playback after the step,
    /// and the events of the step.
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
        // A wrap counts as a jump, so that followers do not play backwards to the start.
        let wrapped = progress.travel.is_some_and(|travel| travel.wraps() || was_at_end && travel.is_forward());
        if progress.jumped || wrapped {
            self.jumps = self.jumps.wrapping_add(1);
        }
        (now, progress)
    }

    /// Compares the playback with its state after the last step: different fields have been set by the game.
    fn notice(&mut self, now: &mut Playback, span: &Span, drive: Drive) -> Progress {
        now.time = span.clamped(now.time);
        now.returning &= span.repeat().turns_round();
        let following = matches!(drive, Drive::Follow { .. });
        let first = self.span.is_none();
        // A changed range may move the time; this is not a seek.
        let turned = span.repeat().turns_round() && now.returning != self.returning;
        let moved = now.time != span.clamped(self.time) || turned;
        // A follower takes its time from the clock; a time set by the game is not a seek.
        let seeked = !first && moved && !(following && now.playing);
        if self.span != Some(*span) {
            self.follow = None;
            self.span = Some(*span);
            self.phase = span.phase(now.time, now.returning);
        }
        let started = now.playing && !self.playing;
        // A playback that is started at its end restarts, unless it follows a clock.
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

    /// Advances by `delta` seconds of the game's time.
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

    /// Plays or jumps to the time of a shared clock.
    fn follow(&mut self, now: &mut Playback, span: &Span, next: Follow, progress: &mut Progress) {
        let before = self.follow.replace(next);
        match before {
            Some(before) if (Follow { phase: before.phase, ..next }) == before => {
                if next.phase != before.phase {
                    let travel = self.go(now, span, before.phase, next.phase);
                    // A step at the end, also backwards and beyond it, stays there.
                    let stays = self.over && now.time == self.time;
                    progress.ended = travel.at_end && !stays;
                    self.over = travel.at_end || stays;
                    progress.travel = Some(travel);
                }
            }
            _ => {
                self.go(now, span, next.phase, next.phase);
                self.fresh = true;
                self.over = span.is_over(next.phase, now.speed >= 0.0);
                // The first step is not a seek.
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

    /// A playback of a capture of two seconds, with its state.
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
    fn start_pause_and_seek_are_reported_once() {
        let mut player = Player::new(Playback::default());
        let first = player.step(Drive::By(0.25));
        assert!(first.started && first.seeked.is_none(), "the first step is a start and not a seek");
        assert!(!player.step(Drive::By(0.25)).started, "the second step is not a start");
        player.0.pause();
        assert!(player.step(Drive::By(0.25)).paused, "a pause is reported");
        assert_eq!(player.step(Drive::By(0.25)), Progress::default(), "a paused step has no events");
        player.0.seek(1.25);
        assert_eq!(player.step(Drive::By(0.25)).seeked, Some([0.5, 1.25]), "a seek while paused is reported");
        player.0.play();
        assert!(player.step(Drive::By(0.25)).started, "a start after a pause is reported");
        assert_eq!(player.0.time, 1.5, "playback continues from the sought time");
    }

    #[test]
    fn the_end_is_reported_once_and_not_as_a_pause() {
        let mut player = Player::new(Playback { repeat: Repeat::Once, ..Playback::default() });
        player.step(Drive::By(1.5));
        let end = player.step(Drive::By(1.5));
        assert!(end.ended && !player.0.playing, "playback ends and stops");
        assert_eq!(player.step(Drive::By(1.5)), Progress::default(), "steps after the end have no events");
        player.0.play();
        let again = player.step(Drive::By(1.5));
        assert_eq!((again.seeked, again.started), (Some([2.0, 0.0]), true), "a start at the end seeks to the start");
        assert!(!again.ended, "a restart is not an end");
        assert_eq!(player.0.time, 1.5, "the restart plays from the start");
        player.0.seek(9.0);
        player.0.pause();
        assert_eq!(player.step(Drive::By(0.0)).seeked, Some([1.5, 2.0]), "a seek beyond the end goes to the end");
        (player.0.speed, player.0.offset) = (-1.0, 0.5);
        player.0.play();
        assert_eq!(player.step(Drive::By(0.5)).seeked, None, "backwards, the out point is not an end");
        assert!(player.step(Drive::By(9.0)).ended, "backwards, playback ends at the start");
        player.0.play();
        player.0.end = 2.0;
        assert_eq!(
            player.step(Drive::By(0.0)).seeked,
            Some([0.0, 1.5]),
            "backwards, a restart begins the offset before the out point"
        );
        let stopped = Playback { time: 2.0, speed: 0.0, repeat: Repeat::Once, ..Playback::default() };
        let mut player = Player::new(stopped);
        player.step(Drive::By(1.0));
        assert_eq!(player.0, stopped, "speed 0 at the end does not restart");
    }

    #[test]
    fn small_steps_add_up_without_rounding_error() {
        let mut player = Player::new(Playback::default());
        for _ in 0..60_000 {
            player.step(Drive::By(1.0 / 60.0));
        }
        let off = player.0.time.min(2.0 - player.0.time);
        assert!(off < 1e-6, "1000 s in steps of 1/60 s are whole loops of 2 s, but the time is {off} s off");
    }

    #[test]
    fn a_clock_sets_the_time_of_its_followers() {
        let mut player = Player::new(Playback { time: 1.75, ..Playback::default() });
        let first = player.follow(10.5, 0);
        assert!(
            first.started && first.seeked.is_none() && player.0.time == 0.5,
            "the first step sets the time of the clock"
        );
        player.0.time = 1.9;
        assert_eq!(player.follow(11.0, 0).seeked, None, "a time set by the game is not a seek");
        assert_eq!(player.0.time, 1.0, "the time is that of the clock");
        assert_eq!(player.follow(12.5, 0).travel.map(|travel| travel.turns), Some(1), "passing the end is one turn");
        assert_eq!(player.follow(13.0, 1).seeked, Some([0.5, 1.0]), "a jump of the clock is reported as a seek");
        player.0.speed = -1.0;
        assert_eq!(player.follow(13.0, 1).seeked, None, "a changed speed that leads to the same time is not a seek");
        player.0.pause();
        player.follow(14.5, 1);
        assert_eq!(player.0.time, 1.0, "a paused follower keeps its time");
        player.0.play();
        player.follow(14.75, 1);
        assert_eq!(player.0.time, 1.25, "a follower that plays again takes the time of the clock");
        player.follow(f64::NAN, 1);
        assert_eq!(player.0.time, 1.25, "the time is kept while the clock shows NaN");
    }

    #[test]
    fn a_follower_ends_each_time_the_clock_passes_its_end() {
        let mut player = Player::new(Playback { repeat: Repeat::Once, offset: -1.0, ..Playback::default() });
        player.follow(0.0, 0);
        assert_eq!(player.0.time, 0.0, "before its start a follower stays at its start");
        player.follow(2.0, 0);
        assert_eq!(player.0.time, 1.0, "an offset of -1 delays the follower by one second");
        assert!(player.follow(3.5, 0).ended && player.0.playing, "a follower at its end keeps following");
        assert!(!player.follow(4.0, 0).ended, "beyond the end no further end is reported");
        assert!(!player.follow(2.0, 0).ended && player.0.time == 1.0, "the follower plays backwards with the clock");
        assert!(player.follow(3.0, 0).ended, "passing the end again is reported again");
        assert!(!player.follow(3.4, 0).ended, "beyond the end");
        assert!(!player.follow(3.3, 0).ended, "backwards beyond the end");
        assert!(!player.follow(3.5, 0).ended, "and forwards again: the time has stayed at the end");
        assert!(player.follow(-1.0, 0).ended, "the other end is another one");
    }

    #[test]
    fn a_time_sought_in_an_empty_range_is_that_of_followers() {
        let mut player = Player::new(Playback { start: 1.0, end: 1.0, ..Playback::default() });
        player.step(Drive::By(0.1));
        player.0.seek(0.75);
        player.step(Drive::By(0.1));
        assert_eq!((player.0.time, player.1.seconds()), (0.75, 0.75), "what is drawn and what is followed");
    }

    #[test]
    fn a_playback_that_no_longer_turns_round_does_not_return() {
        let mut player = Player::new(Playback { repeat: Repeat::PingPong, ..Playback::default() });
        player.step(Drive::By(2.5));
        assert!(player.0.returning, "on its way back");
        player.0.repeat = Repeat::Loop;
        player.step(Drive::Hold);
        assert!(!player.0.returning, "a loop has no way back, also while no time passes");
    }

    #[test]
    fn a_sought_time_is_passed_when_playback_continues() {
        let mut player = Player::new(Playback::default());
        let passes =
            |progress: &Progress, time| progress.travel.is_some_and(|travel| travel.legs().any(|leg| leg.passes(time)));
        assert!(passes(&player.step(Drive::By(0.5)), 0.0), "the first step passes the start");
        assert!(!passes(&player.step(Drive::By(0.5)), 0.5), "a step does not pass the end of the step before");
        player.0.seek(1.5);
        assert!(passes(&player.step(Drive::By(0.25)), 1.5), "a step after a seek passes the sought time");
        player.0.seek(0.25);
        player.0.pause();
        assert!(!passes(&player.step(Drive::By(0.25)), 0.25), "a paused step passes no time");
        player.0.play();
        assert!(passes(&player.step(Drive::By(0.25)), 0.25), "the sought time is passed once playback continues");
    }

    #[test]
    fn the_end_of_a_loop_is_reached_by_a_seek_only() {
        let mut player = Player::new(Playback { start: 0.1, end: 1.9, ..Playback::default() });
        player.step(Drive::By(1.8));
        assert!(
            (player.1.seconds() - 0.1).abs() < 1e-6,
            "a loop played to its end is at its start, not at {}",
            player.1.seconds()
        );
        player.0.pause();
        player.0.seek(1.9);
        player.step(Drive::By(1.0));
        assert!(
            (player.1.seconds() - 1.9).abs() < 1e-6,
            "a seek to the end is at the end, not at {}",
            player.1.seconds()
        );
        assert!(player.1.is_at_end_of_loop(), "the state reports the end of the loop");
        player.0.play();
        player.step(Drive::By(0.25));
        assert!(
            (player.1.seconds() - 0.35).abs() < 1e-6,
            "from its end a loop continues at its start: {}",
            player.1.seconds()
        );
        assert!(!player.1.is_at_end_of_loop(), "the state no longer reports the end of the loop");
    }

    #[test]
    fn infinite_times_are_clamped_to_the_ends() {
        for drive in [Drive::By(0.0), Drive::Hold] {
            let mut player = Player::new(Playback { speed: -1.0, ..Playback::default() });
            player.step(drive);
            player.0.replay();
            assert_eq!(player.step(drive).seeked, Some([0.0, 2.0]), "backwards, replay seeks to the end");
            assert_eq!(player.0.time, 2.0, "without elapsed time the playback stays at the end, {drive:?}");
            player.0.seek(f32::NEG_INFINITY);
            player.step(drive);
            assert_eq!(player.0.time, 0.0, "negative infinity is the start");
        }
    }

    #[test]
    fn times_are_clamped_to_the_range() {
        let mut player = Player::new(Playback { start: 0.5, end: 1.5, ..Playback::paused_at(9.0) });
        assert_eq!(player.step(Drive::By(0.0)).seeked, None, "clamping in the first step is not a seek");
        assert_eq!(player.0.time, 1.5, "the first time is clamped to the out point");
        player.0.seek(-3.0);
        assert_eq!(player.step(Drive::By(0.0)).seeked, Some([1.5, 0.5]), "a seek reports the clamped time");
        player.0.seek(0.25);
        assert_eq!(
            player.step(Drive::By(0.0)).seeked,
            None,
            "a seek that is clamped to the current time is not reported"
        );
        player.0.start = 1.0;
        assert_eq!(player.step(Drive::By(0.0)).seeked, None, "a moved in point is not a seek");
        assert_eq!(player.0.time, 1.0, "the time is clamped to the new in point");
    }

    #[test]
    fn jumps_of_a_player_are_counted_for_its_followers() {
        let mut player = Player::new(Playback::default());
        let mut jumps = |change: fn(&mut Playback), delta| {
            let before = player.1.jumps;
            change(&mut player.0);
            player.step(Drive::By(delta));
            player.1.jumps - before
        };
        assert_eq!(jumps(|_| (), 0.25), 1, "the first step is a jump");
        assert_eq!(jumps(|_| (), 0.5), 0, "elapsed time is not a jump");
        assert_eq!(jumps(|playback| playback.seek(1.75), 0.125), 1, "a seek is a jump");
        assert_eq!(jumps(|_| (), 0.5), 1, "a wrap is a jump");
        assert_eq!(jumps(|playback| playback.repeat = Repeat::PingPong, 1.75), 0, "a turn of ping-pong is not a jump");
    }

    #[test]
    fn a_changed_range_is_not_a_seek() {
        let mut player = Player::new(Playback::default());
        player.step(Drive::By(0.75));
        player.0.end = 1.0;
        assert_eq!(player.step(Drive::By(0.5)).seeked, None, "a moved out point is not a seek");
        assert_eq!(player.0.time, 0.25, "playback wraps at the new out point");
    }
}
