// As much of the library as extras/parts.md uses.
struct AccelStepper {
    enum { DRIVER = 1 };
    AccelStepper(uint8_t, uint8_t, uint8_t) {}
    void setMaxSpeed(float) {}
    void setAcceleration(float) {}
    void moveTo(long) {}
    bool run() { return false; }
    long currentPosition() { return 0; }
};
