// As much of an RP2040's watchdog as the sketches use.
inline bool watchdog_enable_caused_reboot() { return false; }
inline void watchdog_enable(uint32_t, bool) {}
inline void watchdog_update() {}
