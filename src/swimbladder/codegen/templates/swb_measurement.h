/* What a control law sees at a sample. Written by swimbladder. */
#ifndef SWB_MEASUREMENT_H
#define SWB_MEASUREMENT_H

typedef struct {
    float time;    /* s */
    float depth;   /* m, of the pressure sensor, positive down */
    float volume;  /* m3, positive: lighter; 0 at mid-stroke */
    float battery; /* V, where the law has a use for it: with pump and valve */
} swb_measurement;

#endif
