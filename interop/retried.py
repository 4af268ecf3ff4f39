"""Checks that are tried again at once when they failed while the host stood still, and why they cannot bear that.

All others measure what a stall costs them, and excuse it; one that fails all the same is tried again once, when no other runs
(`run.py`). The line of a check that was tried again tells that.
"""

TIMEOUTS = "it counts each frame that a foreign MainDevice loses, and those of its timeouts that are short are its own"
BRING_UP = "KickCAT and SOEM find no line when one of their first frames is late"
CLIENT = "a foreign client that waits too short a time for a frame or a mailbox gives up for good, and says no more"
SHORT_LOOK = "two seconds leave no time to ask again for what a stall left unread"
EACH_FRAME = "each of 800 frames is judged by what the cable did to it, and the host may do the same"

RETRIED = {
    "every_frame_of_a_50_us_cycle_is_accounted_for": "20,000 frames a second leave no time to catch up on",
    "questions_beside_soem_cost_it_no_frame": TIMEOUTS,
    "questions_beside_kickcat_cost_it_no_frame": TIMEOUTS,
    "subdevices_that_do_not_take_udp_are_asked_by_plain_frames_beside_soem_alone": TIMEOUTS,
    "questions_are_no_second_maindevice_in_a_recording": TIMEOUTS,
    "card_of_a_ring_is_refused": BRING_UP,
    "doubled_frames_cost_no_cycle": EACH_FRAME,
    "frames_with_an_unknown_index_cost_no_cycle": EACH_FRAME,
    "truncated_frames_cost_their_cycle": EACH_FRAME,
    "lost_frames_cost_their_cycle": EACH_FRAME,
    "late_frames_cost_their_cycle": EACH_FRAME,
    "noise_beside_soem_is_placed_with_its_direction": CLIENT,
    "noise_beside_kickcat_is_placed_with_its_direction": CLIENT,
    "device_that_spoils_frames_beside_soem_is_named": CLIENT,
    "device_that_spoils_frames_beside_kickcat_is_named": CLIENT,
    "link_that_opened_beside_soem_is_told_by_its_counters": CLIENT,
    "counters_that_a_program_with_soem_prints_name_the_link": CLIENT,
    "a_listener_beside_soem_says_nothing_wrong_of_any_fault": CLIENT,
    "a_listener_beside_kickcat_says_nothing_wrong_of_any_fault": CLIENT,
    "soem_drives_devices_from_descriptions_of_their_makers": CLIENT,
    "a_listener_beside_soem_sees_the_line_cut": CLIENT,
    "linesman_judges_the_idle_line_healthy": SHORT_LOOK,
    "a_listener_beside_soem_sends_nothing": CLIENT,
    "soem_brings_back_a_subdevice_that_lost_its_power": CLIENT,
    "soem_at_mailboxes_with_files_and_boot": CLIENT,
    "soem_reads_and_writes_objects_of_every_length": CLIENT,
    "kickcat_reads_and_writes_objects_of_every_length": CLIENT,
    "soem_takes_one_subdevice_to_op": CLIENT,
    "kickcat_takes_one_subdevice_to_op": CLIENT,
    "soem_takes_the_line_to_op": CLIENT,
    "kickcat_takes_the_line_to_op": CLIENT,
    "soem_takes_the_tree_to_op": CLIENT,
    "kickcat_takes_the_tree_to_op": CLIENT,
    "soem_takes_the_tree_to_op_with_outputs_and_inputs_at_the_same_addresses": CLIENT,
    "soem_keeps_a_ring_that_breaks": CLIENT,
    "kickcat_keeps_a_ring_that_breaks": CLIENT,
    "soem_reads_and_writes_objects_and_the_sii": CLIENT,
}
