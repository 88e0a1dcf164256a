// terrane-client: fetches chunks from a Terrane server and checks what it got.
int main() {
    return 2;
}
