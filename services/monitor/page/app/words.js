// What the server's short names are called on the page.

const stages = {
    camera1: "Camera 1",
    camera2: "Camera 2",
    projector: "Projector",
    pattern: "Pattern",
    pairing: "Pairing",
    windowing: "Windowing",
    phase: "Phase",
    correspondence: "Correspondence",
    cloud: "Cloud",
    recorder: "Recorder",
};

const segments = {
    camera: "Camera",
    pairing: "Pairing",
    phase: "Phase",
    correspondence_queue: "Wait for correspondence",
    correspondence: "Correspondence",
    cloud_queue: "Wait for cloud",
    cloud: "Cloud",
};

const reasons = {
    overrun: "overwritten before it was taken",
    camera_lost: "lost by the camera or its driver",
    duplicate: "came twice",
    late: "came too late",
    unpaired: "no image of the other camera",
    no_pattern: "no pattern for this exposure",
    pattern_conflict: "patterns contradict each other",
    new_session: "a new session began",
    bad_image: "image damaged",
    bad_time: "time stamp not usable",
    incomplete: "window not complete",
    between_windows: "between two windows",
    next_stage_busy: "next stage was busy",
    no_correspondence: "no correspondence found",
    empty_cloud: "cloud without points",
    queue_full: "queue was full",
    disk_full: "no room left on disk",
    not_recording: "not recording",
    restart: "lost by a restart",
    stopped: "scanning was stopped",
    no_sample: "no sample",
    malformed: "message not readable",
    injected: "injected by a test",
    // Incidents: something happened, yet nothing need be lost.
    time_out: "no image in time",
    interrupted: "call interrupted",
    call_refused: "driver refused a call",
    stream_restart: "stream begun again",
    unplugged: "device unplugged",
    returned: "device came back",
    numbering_restart: "numbering began again",
    stamp_ahead: "time stamp in the future",
    stamp_jump: "time stamp jumped",
};

const named = (names) => (name) => names[name] ?? String(name).replaceAll("_", " ");

export const stageName = named(stages);
export const segmentName = named(segments);
export const reasonText = named(reasons);
