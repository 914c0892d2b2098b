//! Challenges and their echoes: exact ages, nothing beyond them, and chance in a replay.

use shared_model::freshness::Challenger;

/// A challenger that has sent `count` challenges, and these.
fn sent(count: usize) -> (Challenger, Vec<u8>) {
    let mut challenger = Challenger::new();
    let challenges = (0..count).map(|_| challenger.challenge()).collect();
    (challenger, challenges)
}

#[test]
fn the_age_of_an_echo_is_exact() {
    for count in 0..200 {
        let (challenger, challenges) = sent(count);
        for (index, &challenge) in challenges.iter().rev().take(15).enumerate() {
            assert_eq!(challenger.age_ticks(challenge), Some(index as u32 + 1));
        }
        // All other bytes are none of the last 15 challenges.
        let known = count.min(15);
        let accepted = (0..=u8::MAX).filter(|&echo| challenger.age_ticks(echo).is_some());
        assert_eq!(accepted.count(), known, "after {count}");
    }
}

#[test]
fn the_low_bits_are_the_number_of_the_challenge() {
    let (_, challenges) = sent(1000);
    for (index, challenge) in challenges.iter().enumerate() {
        assert_eq!(usize::from(challenge & 0xF), (index + 1) % 16);
    }
}

/// A challenge that is too old is taken for a younger one, if its nibble is by chance the same.
#[test]
fn an_old_echo_passes_by_chance_only() {
    const COUNT: usize = 1_000_000;
    let (_, challenges) = sent(COUNT);
    for lag in [16, 32, 48, 240, 256, 272, 512, 4096, 65_536] {
        let same: Vec<bool> = challenges
            .iter()
            .zip(&challenges[lag..])
            .map(|(old, new)| old == new)
            .collect();
        let share = same.iter().filter(|&&same| same).count() as f64 / same.len() as f64;
        assert!((16.0 * share - 1.0).abs() < 0.02, "lag {lag}: {share}");
        let longest = same.split(|&same| !same).map(<[bool]>::len).max();
        assert!(longest.unwrap_or(0) <= 6, "lag {lag}: {longest:?} in a row");
    }
}

#[test]
fn the_nibbles_do_not_repeat_soon() {
    // Eight nibbles are the start of each word; the words of an xorshift differ over its period.
    let (_, challenges) = sent(1_000_000);
    let nibbles: Vec<u8> = challenges.iter().map(|challenge| challenge >> 4).collect();
    let first = &nibbles[..32];
    let again = nibbles[1..].windows(32).filter(|window| *window == first);
    assert_eq!(again.count(), 0);
}
