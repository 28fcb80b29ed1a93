/*
 * Messages that a projector driver, a camera driver or a remote control exchanges with Fringeflow.
 *
 * Layout and names are those of the Rust types in crates/message/src/. Every struct has a fixed size and no hidden
 * padding. The macro FRINGEFLOW_TYPE_… beside a struct is its type name in iceoryx2. The name ends in the layout
 * version, so programs with different versions cannot connect. docs/projector-driver.md says what to send, and when.
 *
 * C11 or C++11; needs no library.
 */
#ifndef FRINGEFLOW_H
#define FRINGEFLOW_H

#include <stdint.h>

#if defined(__cplusplus)
#define FRINGEFLOW_SIZE(type, bytes) static_assert(sizeof(type) == (bytes), #type " has another size")
#else
#define FRINGEFLOW_SIZE(type, bytes) _Static_assert(sizeof(type) == (bytes), #type " has another size")
#endif

/* Names of the channels: iceoryx2 services. */
#define FRINGEFLOW_CHANNEL_PATTERN "projector/pattern"
#define FRINGEFLOW_CHANNEL_CAM1 "cam1/frame"
#define FRINGEFLOW_CHANNEL_CAM2 "cam2/frame"
#define FRINGEFLOW_CHANNEL_STATE "control/state"
#define FRINGEFLOW_CHANNEL_CONTROL "control"

/* Value of fringeflow_pattern_event.kind for phase-shifted sinusoidal fringes. */
#define FRINGEFLOW_PATTERN_FRINGES 1u
/* Values of fringeflow_frame_header.pixel_format, the codes of V4L2: 8 bits, and 10 to 16 bits in the low bits of 16,
 * little endian. */
#define FRINGEFLOW_PIXEL_FORMAT_GREY 0x59455247u
#define FRINGEFLOW_PIXEL_FORMAT_Y10 0x20303159u
#define FRINGEFLOW_PIXEL_FORMAT_Y12 0x20323159u
#define FRINGEFLOW_PIXEL_FORMAT_Y14 0x20343159u
#define FRINGEFLOW_PIXEL_FORMAT_Y16 0x20363159u
/* Bits of fringeflow_frame_header.flags. */
#define FRINGEFLOW_FRAME_DAMAGED 1u        /* marked as damaged by the driver */
#define FRINGEFLOW_FRAME_START_RECKONED 2u /* exposure_start_ns was computed from the end of exposure or transfer */
#define FRINGEFLOW_FRAME_REPLAYED 4u       /* from a recording */
/* Size of a text, bytes. */
#define FRINGEFLOW_TEXT_BYTES 256

/* One pattern of a sequence. Times are nanoseconds of CLOCK_MONOTONIC. */
#define FRINGEFLOW_TYPE_PATTERN_EVENT "fringeflow.PatternEvent.1"
typedef struct {
    uint64_t session;           /* identifies the start of the driver; new after a restart */
    uint64_t sequence;          /* number of the pattern in the session, without gaps */
    uint64_t exposure_start_ns; /* start of the exposure that the pattern lights */
    uint64_t duration_ns;       /* how long the pattern is shown */
    double period_px;           /* fringe period, projector pixels */
    uint32_t step;              /* step of the phase shift, from 0 */
    uint32_t steps;             /* steps of the cycle */
    uint32_t kind;              /* FRINGEFLOW_PATTERN_FRINGES; images of other patterns are left out */
    uint32_t reserved;          /* zero */
} fringeflow_pattern_event;
FRINGEFLOW_SIZE(fringeflow_pattern_event, 56);

/* One image of one camera: the user header of a byte slice with height_px rows of stride_bytes. */
#define FRINGEFLOW_TYPE_FRAME_HEADER "fringeflow.FrameHeader.1"
typedef struct {
    uint64_t session;           /* identifies the start of the camera's stream */
    uint64_t sequence;          /* number of the image, from the driver; gaps are images that the camera lost */
    uint64_t published;         /* images that the channel has carried before */
    uint64_t exposure_start_ns; /* start of the exposure */
    uint64_t received_ns;       /* arrival of the image on this machine */
    uint64_t exposure_ns;       /* duration of the exposure, nanoseconds; 0 if unknown */
    uint32_t width_px;
    uint32_t height_px;
    uint32_t stride_bytes; /* bytes from one row to the next */
    uint32_t pixel_format; /* FRINGEFLOW_PIXEL_FORMAT_… */
    uint32_t flags;        /* FRINGEFLOW_FRAME_… */
    uint32_t camera;       /* 1 or 2 */
} fringeflow_frame_header;
FRINGEFLOW_SIZE(fringeflow_frame_header, 72);

/* A short UTF-8 text, padded with zeros. */
#define FRINGEFLOW_TYPE_TEXT "fringeflow.Text.1"
typedef struct {
    uint8_t bytes[FRINGEFLOW_TEXT_BYTES];
} fringeflow_text;
FRINGEFLOW_SIZE(fringeflow_text, FRINGEFLOW_TEXT_BYTES);

/* The state that the instance should have. Drivers follow `scanning`. */
#define FRINGEFLOW_TYPE_SCAN_STATE "fringeflow.ScanState.1"
typedef struct {
    uint64_t revision;              /* raised with every change */
    uint32_t scanning;              /* 1 while cameras and projector should run */
    uint32_t recording;             /* 1 while a recording should run */
    uint64_t recordings;            /* recordings started so far */
    uint64_t marks;                 /* marks set so far */
    fringeflow_text recording_file; /* file of the recording */
    fringeflow_text mark;           /* text of the last mark */
} fringeflow_scan_state;
FRINGEFLOW_SIZE(fringeflow_scan_state, 544);

/* Values of fringeflow_control_request.command. */
#define FRINGEFLOW_COMMAND_STATE 0u        /* report the state */
#define FRINGEFLOW_COMMAND_START 1u        /* start cameras and projector */
#define FRINGEFLOW_COMMAND_STOP 2u         /* stop cameras and projector; the services stay */
#define FRINGEFLOW_COMMAND_RECORD_START 3u /* start a recording; text: its file, or empty for a default name */
#define FRINGEFLOW_COMMAND_RECORD_STOP 4u  /* end the recording */
#define FRINGEFLOW_COMMAND_MARK 5u         /* write the text into the recording, with the time */
#define FRINGEFLOW_COMMAND_QUIT 6u         /* end the instance */

/* A request to the instance. */
#define FRINGEFLOW_TYPE_CONTROL_REQUEST "fringeflow.ControlRequest.1"
typedef struct {
    uint32_t command;     /* FRINGEFLOW_COMMAND_… */
    uint32_t reserved;    /* zero */
    fringeflow_text text; /* argument of the command */
} fringeflow_control_request;
FRINGEFLOW_SIZE(fringeflow_control_request, 264);

/* The answer to a request. */
#define FRINGEFLOW_TYPE_CONTROL_RESPONSE "fringeflow.ControlResponse.1"
typedef struct {
    uint32_t refused;            /* 0: done; 1: refused, the text says why */
    uint32_t reserved;           /* zero */
    fringeflow_scan_state state; /* the state after the command */
    fringeflow_text text;        /* what was done, or why it was refused */
} fringeflow_control_response;
FRINGEFLOW_SIZE(fringeflow_control_response, 808);

#endif
