//! The study `feel`: what the passivity stage changes for the hand.

use hbot_study::Study;

use crate::{assert_documented, assert_holds, measure};

#[test]
fn the_stage_is_not_felt_in_ready_made_scenes_and_calms_what_shakes() {
    let report = measure(Study::Feel);
    assert_documented(&report);
    assert_holds(&report);
}
