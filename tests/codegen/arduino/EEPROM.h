// As much of the EEPROM in flash as the sketches use.
struct StubEeprom {
    uint8_t cells[4096];
    void begin(size_t) { memset(cells, 0xff, sizeof cells); }
    uint8_t read(int at) { return cells[at]; }
    void write(int at, uint8_t byte) { cells[at] = byte; }
    bool commit() { return true; }
};
static StubEeprom EEPROM;
