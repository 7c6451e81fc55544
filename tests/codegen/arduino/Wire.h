// As much of the two-wire bus as extras/parts.md uses.
struct StubWire {
    void begin() {}
    void beginTransmission(uint8_t) {}
    uint8_t endTransmission() { return 0; }
};
static StubWire Wire;
