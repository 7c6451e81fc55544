// As much of Blue Robotics' library as extras/parts.md uses.
struct MS5837 {
    static const uint8_t MS5837_30BA = 0;
    bool init() { return true; }
    void setModel(uint8_t) {}
    void read() {}
    float pressure(float = 1.0f) { return 1013.25f; } // mbar
};
