// As much of an ESP32's system as the sketches use.
enum esp_reset_reason_t { ESP_RST_UNKNOWN, ESP_RST_POWERON };
inline esp_reset_reason_t esp_reset_reason() { return ESP_RST_POWERON; }
inline void enableLoopWDT() {}
