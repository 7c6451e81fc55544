/* What a control law sees at a sample. Written by swimbladder. */
#ifndef SWB_MEASUREMENT_H
#define SWB_MEASUREMENT_H

typedef struct {
    float time;   /* s */
    float depth;  /* m, of the pressure sensor, positive down */
    float volume; /* m3, positive: lighter; 0 at mid-stroke */
} swb_measurement;

#endif
