// As much of an STM32's watchdog as the sketches use.
struct StubWatchdog {
    bool isReset(bool) { return false; }
    void begin(uint32_t) {}
    void reload() {}
};
static StubWatchdog IWatchdog;
