// As much of Blue Robotics' library as extras/parts.md uses.
struct KellerLD {
    void init() {}
    void read() {}
    float pressure(float = 1.0f) { return 1013.25f; } // mbar
};
